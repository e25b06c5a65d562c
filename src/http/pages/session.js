// What both pages share: requests with the token that was typed in, kept for this tab alone.
"use strict";

const TOKEN = "triplanar-token";

function token() {
  return sessionStorage.getItem(TOKEN) || "";
}

function keepToken(text) {
  if (text) sessionStorage.setItem(TOKEN, text);
  else sessionStorage.removeItem(TOKEN);
}

/** fetch with the token, if there is one. */
function ask(path, options = {}) {
  const headers = new Headers(options.headers || {});
  if (token()) headers.set("Authorization", "Bearer " + token());
  return fetch(path, { ...options, headers });
}

/** The problem that an answer tells, as one line. */
async function problemOf(response) {
  try {
    const problem = await response.json();
    return problem.title + ": " + problem.detail;
  } catch {
    return response.status + " " + response.statusText;
  }
}

/** An element with text and children; texts are never read as HTML. */
function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}
