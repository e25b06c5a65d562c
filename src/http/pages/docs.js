// Shows openapi.json so that people can read it.
"use strict";

/** Markdown as far as our descriptions have it: code in backticks. */
function marked(name, text) {
  const parts = String(text).split("`").map((part, index) => (index % 2 ? element("code", { textContent: part }) : part));
  return element(name, {}, ...parts);
}

function paragraphs(text) {
  return (text || "").split("\n\n").filter(Boolean).map((part) => marked("p", part));
}

/** A schema in one line. */
function brief(schema) {
  if (!schema) return "";
  if (schema.$ref) return schema.$ref.split("/").pop();
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" | ");
  const either = schema.oneOf || schema.anyOf || schema.allOf;
  if (either) return either.map(brief).join(schema.allOf ? " & " : " | ");
  if (schema.const !== undefined) return JSON.stringify(schema.const);
  const type = Array.isArray(schema.type) ? schema.type.join(" | ") : schema.type || "any";
  if (schema.type === "array") return "list of " + brief(schema.items);
  const range = ["minimum", "maximum", "pattern", "format"]
    .filter((key) => schema[key] !== undefined)
    .map((key) => key + " " + schema[key]);
  return range.length ? type + " (" + range.join(", ") + ")" : type;
}

function table(heads, rows) {
  return element("div", { className: "scroll" }, element(
    "table",
    {},
    element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { textContent: head })))),
    element("tbody", {}, ...rows.map((cells) =>
      element("tr", {}, ...cells.map((cell) => marked("td", cell))))),
  ));
}

function parametersOf(operation) {
  const rows = (operation.parameters || []).map((parameter) =>
    [parameter.name, parameter.in, brief(parameter.schema), parameter.description || ""]);
  return rows.length ? [element("h3", { textContent: "Parameters" }), table(["Name", "In", "Type", ""], rows)] : [];
}

function bodyOf(operation) {
  if (!operation.requestBody) return [];
  const rows = Object.entries(operation.requestBody.content).map(([type, content]) => [type, brief(content.schema)]);
  return [element("h3", { textContent: "Body" }), table(["Media type", "Schema"], rows)];
}

function answersOf(operation) {
  const rows = Object.entries(operation.responses).map(([status, response]) => {
    const types = Object.entries(response.content || {})
      .map(([type, content]) => type + " " + brief(content.schema));
    return [status, response.description, types.join(", ")];
  });
  return [element("h3", { textContent: "Answers" }), table(["Status", "", "Content"], rows)];
}

function operationElement(path, method, operation) {
  return element(
    "details",
    {},
    element("summary", {}, element("span", { className: "method", textContent: method.toUpperCase() }),
      element("code", { textContent: path }), " " + (operation.summary || "")),
    ...paragraphs(operation.description),
    ...parametersOf(operation),
    ...bodyOf(operation),
    ...answersOf(operation),
  );
}

function schemaElement(name, schema) {
  const rows = Object.entries(schema.properties || {}).map(([property, inner]) =>
    [property, brief(inner), inner.description || ""]);
  return element("details", {}, element("summary", {}, element("code", { textContent: name })),
    ...paragraphs(schema.description),
    rows.length ? table(["Field", "Type", ""], rows) : element("p", { textContent: brief(schema) }));
}

async function show() {
  const api = await (await fetch("/openapi.json")).json();
  document.getElementById("about").replaceWith(...paragraphs(api.info.description));
  const groups = new Map();
  for (const [path, item] of Object.entries(api.paths)) {
    for (const [method, operation] of Object.entries(item)) {
      const tag = (operation.tags || ["Other"])[0];
      if (!groups.has(tag)) groups.set(tag, []);
      groups.get(tag).push(operationElement(path, method, operation));
    }
  }
  const main = document.getElementById("operations");
  for (const [tag, operations] of groups) {
    main.append(element("h2", { textContent: tag }), ...operations);
  }
  const schemas = Object.entries(api.components.schemas).map(([name, schema]) => schemaElement(name, schema));
  document.getElementById("schemas").append(...schemas);
}

show();
