// Data out, and fits: "Share" and "Fit this".
import { byId, element } from "./util.js";
import { addSubject, fragment, hasRoom, on, session, tellFull } from "./session.js";
import { post } from "./link.js";
import { cards } from "./card.js";

export function startDialogs() {
  const offer = () => {
    for (const what of ["xml", "dict", "command"])
      byId(`copy-${what}`).disabled = !session.info[session.selected]?.[what];
  };
  on("subject", offer);
  byId("share").onclick = () => {
    offer();
    byId("share-of").textContent = session.state.subjects[session.selected]?.name ?? "";
    byId("share-dialog").showModal();
  };
  for (const what of ["xml", "dict", "command"])
    byId(`copy-${what}`).onclick = () => copy(session.info[session.selected][what], what);
  byId("copy-link").onclick = () => {
    const uploaded = session.state.subjects.filter(({ bsdf }) => bsdf.file?.startsWith("upload-"));
    const warning = uploaded.length ? ` It works only while this server runs, which has the uploaded ${uploaded[0].name}.` : "";
    copy(location.href.replace(/#.*/, "") + fragment(), "link", warning);
  };
  byId("save-png").onclick = () => cards.picture.tools.querySelector("button")?.click();
  byId("save-exr").onclick = () => ask({ type: "save", what: "exr", subject: session.selected });
  byId("save-page").onclick = () => ask({ type: "save", what: "page", state: session.state });
  on("saved", () => (byId("shared").textContent = "Saved."));
  startFit();
  for (const button of document.querySelectorAll("dialog .close"))
    button.onclick = () => button.closest("dialog").close();
  for (const dialog of document.querySelectorAll("dialog")) {
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    dialog.addEventListener("close", () => (byId("shared").textContent = ""));
  }
}

function ask(message) {
  byId("shared").textContent = post(message) ? "The server is at it …" : "The server does not answer.";
}

async function copy(text, what, warning = "") {
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

let fitted = null;

function startFit() {
  const [dialog, start] = [byId("fit-dialog"), byId("fit-start")];
  const running = (yes) => {
    start.hidden = yes;
    byId("fit-cancel").hidden = byId("fit-progress").hidden = !yes;
  };
  byId("fit").onclick = () => {
    fitted = session.selected;
    byId("fit-of").textContent = session.state.subjects[fitted].name;
    const options = (words) => words.map((word) => element("option", { value: word }, word));
    byId("fit-model").replaceChildren(...options(session.hello.models));
    byId("fit-metric").replaceChildren(...options(session.hello.metrics));
    byId("fit-told").textContent = "";
    running(false);
    dialog.showModal();
  };
  start.onclick = () => {
    byId("fit-told").textContent = "";
    byId("fit-progress").removeAttribute("value");
    running(post({ type: "fit", subject: fitted, model: byId("fit-model").value, metric: byId("fit-metric").value }));
  };
  byId("fit-cancel").onclick = () => {
    post({ type: "cancel" });
    running(false);
    byId("fit-told").textContent = "Cancelled.";
  };
  dialog.addEventListener("close", () => !byId("fit-cancel").hidden && byId("fit-cancel").onclick());
  on("connection", () => running(false));
  on("fit", ({ done, total, bsdf, text, error }) => {
    if (byId("fit-cancel").hidden) return;
    if (total) Object.assign(byId("fit-progress"), { max: total, value: done });
    if (!bsdf && !error) return void (byId("fit-told").textContent = total ? `${done} of ${total}` : "");
    running(false);
    byId("fit-told").textContent = error ?? text ?? "";
    if (!bsdf) return;
    if (hasRoom()) addSubject(bsdf, `${bsdf.type}, fitted`);
    else tellFull("and fit again");
  });
}
