// Data out, and fits: "Share" and "Fit this".
import { byId, element, format, save, subscripted } from "./util.js";
import { addSubject, change, changeSubject, fragment, hasRoom, on, session, tellFull } from "./session.js";
import { post } from "./link.js";
import { cards } from "./card.js";

export function startDialogs() {
  const written = ["xml", "dict", "command"];
  const offer = () => {
    for (const what of written) byId(`copy-${what}`).disabled = !session.info[session.selected]?.[what];
  };
  on("subject", offer);
  byId("share").onclick = () => {
    offer();
    byId("share-of").textContent = session.state.subjects[session.selected]?.name ?? "";
    byId("share-dialog").showModal();
  };
  for (const what of written)
    byId(`copy-${what}`).onclick = () =>
      copy(session.info[session.selected][what], what, [session.state.subjects[session.selected]]);
  byId("copy-link").onclick = () =>
    copy(location.href.replace(/#.*/, "") + fragment(), "link", session.state.subjects);
  byId("save-png").onclick = () => cards.picture.tools.querySelector("button")?.click();
  byId("save-exr").onclick = () => ask({ type: "save", what: "exr", subject: session.selected });
  byId("save-page").onclick = () => ask({ type: "save", what: "page", state: session.state });
  byId("write-scene").onclick = () => ask({ type: "save", what: "scene", subject: session.selected });
  on("hello", () => (byId("scene-row").hidden = !session.hello.scene));
  for (const event of ["written", "error"])
    on(event, ({ text }) => byId("share-dialog").open && (byId("shared").textContent = text));
  on("file", ({ name, data, mime }) => {
    save(name, data, mime);
    byId("shared").textContent = "Saved.";
  });
  startFit();
  for (const dialog of document.querySelectorAll("dialog")) {
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    dialog.addEventListener("close", () => (byId("shared").textContent = ""));
  }
}

function ask(message) {
  byId("shared").textContent = post(message) ? "The server is at it …" : "The server does not answer.";
}

async function copy(text, what, subjects) {
  const uploaded = subjects.find(({ bsdf }) => bsdf.file?.startsWith("upload-"));
  const warning = uploaded ? ` It works only while this server runs, which has the uploaded ${uploaded.name}.` : "";
  try {
    await navigator.clipboard.writeText(text);
    byId("shared").textContent = `Copied the ${what}.${warning}`;
  } catch {
    // Without the permission, or from a file: an old way that needs none.
    const area = byId("share-dialog").appendChild(element("textarea", {}, text));
    area.select();
    byId("shared").textContent = document.execCommand("copy")
      ? `Copied the ${what}.${warning}`
      : "The browser does not let the page copy.";
    area.remove();
  }
}

// --- Fits -----------------------------------------------------------------------------------------------------------

/** The measured file that models are fitted to, and the fits, the best first. */
let fitted = null;
let ranking = [];

function startFit() {
  const dialog = byId("fit-dialog");
  const running = (yes) => {
    byId("fit-start").hidden = yes;
    byId("fit-cancel").hidden = byId("fit-progress").hidden = !yes;
    byId("fit").textContent = "Fit this …";
  };
  const begin = (told = "") => {
    ranking = [];
    byId("fit-told").textContent = told;
    drawRanking();
  };
  const cancel = (told) => {
    post({ type: "cancel" });
    running(false);
    byId("fit-told").textContent = told;
  };
  const explain = () => {
    const told = `compares ${session.hello.metrics[byId("fit-metric").value]}`;
    byId("fit-compared").replaceChildren(...subscripted(told));
  };
  byId("fit-metric").onchange = explain;
  byId("fit").onclick = () => {
    const { bsdf, name } = session.state.subjects[session.selected];
    if (fitted !== bsdf.file) {
      cancel("");
      begin();
      fitted = bsdf.file;
      const options = (words, told = {}) => words.map((word) => element("option", { value: word }, told[word] ?? word));
      byId("fit-model").replaceChildren(...options(["all", ...session.hello.models], { all: "all, and rank them" }));
      byId("fit-metric").replaceChildren(...options(Object.keys(session.hello.metrics)));
      explain();
    }
    byId("fit-of").textContent = name;
    dialog.showModal();
  };
  byId("fit-start").onclick = () => {
    begin();
    byId("fit-progress").removeAttribute("value");
    const [model, metric] = [byId("fit-model").value, byId("fit-metric").value];
    running(post({ type: "fit", subject: session.selected, model, metric }));
  };
  byId("fit-cancel").onclick = () => cancel("Cancelled.");
  on("connection", () => running(false));
  on("fit", ({ done, total, ...fit }) => {
    if (byId("fit-cancel").hidden) return;
    Object.assign(byId("fit-progress"), { max: total, value: done });
    byId("fit").textContent = byId("fit-told").textContent = `Fitting ${Math.floor(done) + 1} of ${total} …`;
    if (!fit.bsdf) return;
    ranking = [...ranking, fit].sort((a, b) => (a.error ?? Infinity) - (b.error ?? Infinity));
    drawRanking();
  });
  on("fitted", ({ error }) => {
    running(false);
    const best = `Errors are those on directions that were not fitted, over the best, ${format(ranking[0]?.error, 2)}.`;
    byId("fit-told").textContent = error ?? best;
  });
}

function drawRanking() {
  byId("fit-ranking").hidden = !ranking.length;
  byId("fit-ranking").tBodies[0].replaceChildren(
    ...ranking.map((fit) =>
      element(
        "tr",
        { title: fit.text },
        element("td", {}, fit.model),
        element("td", {}, fit.error === null ? "–" : (fit.error / ranking[0].error).toFixed(2)),
        element("td", {}, element("button", { class: "small", onclick: () => showFit(fit) }, "Show")),
      ),
    ),
  );
  byId("fit-remarks").textContent = ranking.length && ranking[0].text ? `${ranking[0].model}:\n${ranking[0].text}` : "";
}

/** Wipe a fit over what was measured, alone with it; it takes the place of another fit. */
function showFit({ bsdf, model }) {
  const told = (it) => JSON.stringify(it.bsdf);
  const known = ranking.map(told);
  const subject = { bsdf, name: `${model}, fitted`, hidden: false };
  let at = session.state.subjects.findIndex((it) => known.includes(told(it)));
  if (at < 0) {
    if (!hasRoom()) return tellFull();
    addSubject(bsdf, subject.name);
    at = session.state.subjects.length - 1;
  } else {
    changeSubject(at, subject);
  }
  const measured = session.state.subjects.findIndex((it) => it.bsdf.file === fitted);
  const subjects = session.state.subjects.map((it, k) => ({ ...it, hidden: k !== measured && k !== at }));
  if (measured >= 0) change({ compare: "wipe", pair: [measured, at], subjects });
  byId("fit-dialog").close();
}
