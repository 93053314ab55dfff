// A card of the page: a heading, buttons, a figure, and a line for the values under the pointer.
import { block, element, save, shape, standalone, subscripted } from "./util.js";
import { session } from "./session.js";

export const cards = {};

/** Add a card for a view, which `draw` draws; it can be saved if there is an `image`, a canvas, or a `table` of curves. */
export function makeCard(view, { title, note = "", draw, image, table }) {
  const tools = block("tools");
  const figure = block(`figure ${view}`);
  const readout = element("output", { class: "readout" });
  const card = { view, title, draw, image, table, figure, readout, tools, legend: [] };
  for (const kind of image ? ["PNG"] : ["SVG", "CSV"]) {
    tools.append(
      element(
        "button",
        { class: "quiet", "aria-label": `${title}: save as ${kind}`, onclick: () => saveAs(card, kind) },
        kind,
      ),
    );
  }
  card.note = element("span", { class: "note" }, ...subscripted(note));
  card.node = element(
    "section",
    { class: "card", id: `view-${view}`, "aria-label": title },
    element("header", {}, element("div", {}, element("h2", {}, title), card.note), tools),
    figure,
    readout,
  );
  cards[view] = card;
  return card;
}

function saveAs(card, kind) {
  const name = `${session.state.subjects
    .map((subject) => subject.name)
    .join("-")
    .replace(/[^\p{L}\p{N}.-]+/gu, "_")}-${card.view}`;
  if (kind === "SVG") {
    const figures = [...card.figure.querySelectorAll("svg")];
    figures.forEach((figure, k) =>
      save(`${name}${figures.length > 1 ? `-${k + 1}` : ""}.svg`, standalone(figure), "image/svg+xml"),
    );
  } else if (kind === "CSV") {
    save(
      `${name}.csv`,
      card
        .table()
        .map((row) => row.map(quoted).join(","))
        .join("\n") + "\n",
      "text/csv",
    );
  } else {
    card.image()?.toBlob((blob) => save(`${name}.png`, blob));
  }
}

const quoted = (cell) => (/[",\n]/.test(String(cell)) ? `"${String(cell).replace(/"/g, '""')}"` : String(cell ?? ""));

/** Show values in the line below the figure, or else its legend: texts with a colour, and the dashes of a curve. */
export function tell(card, items) {
  card.readout.replaceChildren(
    ...(items.length ? items : card.legend).map(([colour, text, dash]) => {
      if (dash === undefined) {
        const attributes = { style: colour ? `--mark:${colour}` : null, class: colour ? "marked" : null };
        return element("span", attributes, element("span", {}, ...subscripted(text)));
      }
      return element(
        "span",
        {},
        shape(
          "svg",
          { width: 24, height: 8, class: "sample", "aria-hidden": "true" },
          shape("line", { x1: 0, y1: 4, x2: 24, y2: 4, stroke: colour, "stroke-width": 2, "stroke-dasharray": dash }),
        ),
        text,
      );
    }),
  );
}
