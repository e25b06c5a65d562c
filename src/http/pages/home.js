// The latest series with their reconstructions, and the upload form.
"use strict";

const ROWS = 20;
const REFRESH_MS = 3000;
const byId = (id) => document.getElementById(id);

/** Downloads with the token: a plain link can't send one. */
async function download(path, name) {
  const response = await ask(path);
  if (!response.ok) {
    say(await problemOf(response));
    return;
  }
  const url = URL.createObjectURL(await response.blob());
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

function link(text, path, name) {
  const made = element("a", { href: path, textContent: text });
  made.addEventListener("click", (event) => {
    event.preventDefault();
    download(path, name);
  });
  return made;
}

function say(text) {
  byId("series-state").textContent = text;
}

function reconstructionCell(reconstruction) {
  if (!reconstruction) return element("td", { textContent: "–" });
  const cell = element("td", { textContent: reconstruction.state + " " });
  if (reconstruction.state === "running") {
    cell.append(element("progress", { max: 1, value: reconstruction.fraction }), " " + (reconstruction.stage || ""));
  }
  if (reconstruction.error) {
    const { code, detail, instances } = reconstruction.error;
    const named = instances.length ? ` (instances named: ${instances.length})` : "";
    cell.append(element("span", { className: "bad", textContent: code }),
      element("div", { className: "note", textContent: detail + named }));
  }
  if (reconstruction.figures) {
    cell.append(reconstruction.figures.after_statistical.toLocaleString() + " points");
  }
  if (reconstruction.quality) {
    const { verdict, doubts } = reconstruction.quality;
    const text = doubts.length ? verdict + " (" + doubts.join(", ") + ")" : verdict;
    cell.append(", ", element("span", { className: verdict === "insufficient" ? "bad" : "", textContent: text }));
  }
  return cell;
}

function linksCell(reconstruction) {
  const cell = element("td");
  if (reconstruction && reconstruction.error) {
    cell.append(link("details", reconstruction.links.self, "triplanar-" + reconstruction.id + ".details.json"), " ");
  }
  if (reconstruction && reconstruction.links.cloud) {
    cell.append(link("cloud", reconstruction.links.cloud, "triplanar-" + reconstruction.id + ".ply"), " ");
  }
  if (reconstruction && reconstruction.links.report) {
    cell.append(link("report", reconstruction.links.report, "triplanar-" + reconstruction.id + ".json"));
  }
  return cell;
}

function row(detail) {
  return element(
    "tr",
    {},
    element("td", {}, element("span", { className: "uid", textContent: detail.series_instance_uid }),
      detail.description ? element("div", { className: "note", textContent: detail.description }) : null),
    element("td", { textContent: detail.unfit_reason ? "kept: " + detail.unfit_reason : detail.state },
      detail.unfit_detail ? element("div", { className: "note", textContent: detail.unfit_detail }) : null),
    element("td", { textContent: detail.instances }),
    reconstructionCell(detail.reconstruction),
    linksCell(detail.reconstruction),
  );
}

async function showSeries() {
  const response = await ask("/v1/series?limit=" + ROWS);
  byId("token-form").hidden = response.status !== 401 && response.status !== 403;
  if (!response.ok) {
    byId("series").hidden = true;
    say(await problemOf(response));
    return;
  }
  const page = await response.json();
  const details = await Promise.all(
    page.items.map(async (series) => {
      const detail = await ask(series.links.self);
      return detail.ok ? detail.json() : series;
    }),
  );
  byId("series").hidden = details.length === 0;
  byId("series").tBodies[0].replaceChildren(...details.map(row));
  say(details.length === 0 ? "Nothing was received yet." : "");
}

async function refresh() {
  try {
    if (!document.hidden) await showSeries();
  } catch {
    say("The service does not answer.");
  }
  setTimeout(refresh, REFRESH_MS);
}

byId("token-form").addEventListener("submit", (event) => {
  event.preventDefault();
  keepToken(byId("token").value.trim());
  byId("token").value = "";
  showSeries();
});

byId("upload-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const request = new XMLHttpRequest(); // fetch does not tell how much was sent
  const progress = byId("upload-progress");
  const answer = byId("upload-answer");
  request.open("POST", "/v1/series");
  if (token()) request.setRequestHeader("Authorization", "Bearer " + token());
  request.upload.addEventListener("progress", (sent) => {
    progress.hidden = false;
    progress.value = sent.loaded / Math.max(sent.total, 1);
  });
  request.addEventListener("loadend", () => {
    progress.hidden = true;
    let told = null;
    try {
      told = JSON.parse(request.responseText);
    } catch {
      // no answer, or not ours
    }
    if (request.status === 202 && told) {
      const counts = told.instances;
      answer.textContent = `${counts.stored} stored, ${counts.duplicate} there before, ` +
        `${counts.refused} refused, ${counts.skipped} passed over`;
      showSeries();
    } else {
      answer.textContent = told ? `${told.title}: ${told.detail}` : "The upload failed.";
    }
  });
  request.send(new FormData(event.target));
});

refresh();
