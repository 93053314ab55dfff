// The subjects: chips, the editor's head, and the dialog that adds one.
import { PALETTE, byId, element } from "./util.js";
import { addSubject, change, changeSubject, emit, hasRoom, on, removeSubject, session } from "./session.js";
import { colourOf } from "./drawing.js";
import { drawControls, drawScrubbers, resetAll } from "./controls.js";

const MOST_FOUND = 80;

export function startSubjects() {
  byId("add").onclick = openAdd;
  byId("subject-name").onchange = ({ target }) => changeSubject(session.selected, { name: target.value || "unnamed" });
  byId("solo").onclick = solo;
  byId("hide").onclick = () =>
    changeSubject(session.selected, { hidden: !session.state.subjects[session.selected].hidden });
  byId("remove").onclick = () => removeSubject(session.selected);
  byId("double").onclick = () => {
    const { bsdf, name } = session.state.subjects[session.selected];
    addSubject(structuredClone(bsdf), `${name} 2`);
  };
  byId("reset").onclick = resetAll;
  byId("colour").onclick = nextColour;
  byId("search").oninput = showFound;
  byId("add-dialog").addEventListener("keydown", walk);
  byId("file").onchange = ({ target }) => {
    uploadAll(target.files);
    target.value = "";
  };
  byId("choose-file").onclick = () => byId("file").click();
  startDrop();
  on("hello", showFound);
}

export function drawSubjects() {
  const { subjects } = session.state;
  const focused = document.activeElement?.dataset?.chip;
  byId("chips").replaceChildren(
    ...subjects.map((subject, k) =>
      element(
        "button",
        {
          class: `chip${subject.hidden ? " hidden" : ""}`,
          "data-chip": k,
          "aria-pressed": String(k === session.selected),
          style: `--mark:${colourOf(k)}`,
          onclick: () => {
            session.selected = k;
            emit("selected");
          },
        },
        subject.name,
        session.info[k]?.error ? element("span", { class: "warning", title: session.info[k].error }, " !") : null,
      ),
    ),
  );
  if (focused) byId("chips").children[focused]?.focus();
  byId("add").hidden = session.exported || !hasRoom();
  const subject = subjects[session.selected];
  byId("editor").hidden = !subject;
  if (!subject) return;
  const field = byId("subject-name");
  if (document.activeElement !== field) field.value = subject.name;
  const { type, name } = subject.bsdf;
  byId("subject-type").textContent = type === "preset" ? `preset ${name}` : type === subject.name ? "" : type;
  byId("colour").style.setProperty("--mark", colourOf(session.selected));
  byId("hide").textContent = subject.hidden ? "Show" : "Hide";
  byId("solo").disabled = byId("remove").disabled = subjects.length < 2;
  byId("double").disabled = !hasRoom();
  byId("fit").hidden = subject.bsdf.type !== "tabulated" || !session.hello?.models?.length;
  drawControls();
  drawScrubbers();
}

/** Show the selected subject alone, or all again. */
function solo() {
  const { subjects } = session.state;
  const alone = subjects.every(({ hidden }, k) => hidden === (k !== session.selected));
  change({ subjects: subjects.map((subject, k) => ({ ...subject, hidden: alone ? false : k !== session.selected })) });
}

/** Give the subject the next colour, and its own to whom that belongs. */
function nextColour() {
  const { subjects } = session.state;
  const [own, next] = [subjects[session.selected].colour, (subjects[session.selected].colour + 1) % PALETTE.length];
  change({
    subjects: subjects.map((subject, k) => ({
      ...subject,
      colour: k === session.selected ? next : subject.colour === next ? own : subject.colour,
    })),
  });
}

// --- Adding ---------------------------------------------------------------------------------------------------------

function openAdd() {
  byId("search").value = "";
  showFound();
  byId("add-dialog").showModal();
  byId("search").focus();
}

function showFound() {
  const { hello } = session;
  if (!hello) return;
  const words = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const fits = (...texts) => words.every((word) => texts.join(" ").toLowerCase().includes(word));
  const groups = {};
  const offer = (group, make) => (groups[group] ??= []).push(make);
  const own = hello.types.filter(({ group }) => group === "mi_brdfs").length;
  hello.types.forEach(({ name, title, group }, at) => {
    const ball = () => (at < own ? ballOf("models", at, own, own) : null);
    const text = title === name ? "" : title;
    if (fits(name, title, group)) offer(group, () => foundItem({ type: name }, name, text, ball()));
  });
  for (const { file, name, kind } of hello.files) {
    const type = kind === "material" ? "given" : "tabulated";
    if (fits(name, "file measured")) offer("Files", () => foundItem({ type, file }, name));
  }
  const presets = {};
  hello.presets.forEach((name, at) => {
    const material = name.split("/").at(-1);
    if (fits(name, material.replaceAll("-", " "), "preset")) (presets[material] ??= []).push([name, at]);
  });
  for (const material of Object.keys(presets).sort()) offer("Presets", () => ballsOf(material, presets[material]));
  let room = words.length ? MOST_FOUND : 400;
  const nodes = Object.entries(groups).flatMap(([title, makers]) => {
    const shown = makers.slice(0, words.length || title !== "Presets" ? room : Math.min(room, 12));
    room -= shown.length;
    const more = makers.length - shown.length;
    return [
      element("h3", {}, title),
      element("ul", {}, ...shown.map((make) => make())),
      ...(more ? [element("p", { class: "note" }, `and ${more} more: type to search`)] : []),
    ];
  });
  byId("found").replaceChildren(...(nodes.length ? nodes : [element("p", {}, "Nothing has this name.")]));
}

function foundItem(bsdf, name, text = "", ball = null) {
  const told = element("div", {}, element("b", {}, name), text ? element("span", {}, text) : null);
  return element("li", {}, element("button", { class: "found", onclick: () => choose(bsdf, name) }, ball, told));
}

/** Return a ball of a sheet, by its number in rows of `across`. */
function ballOf(sheet, at, across, count) {
  const [column, last] = [at % across, Math.ceil(count / across) - 1];
  const place = `${(100 * column) / (across - 1)}% ${(100 * (at - column)) / across / (last || 1)}%`;
  return element("i", { class: "of-sheet", style: `background:url(client/${sheet}.jpg) ${place} / ${100 * across}%` });
}

/** Return a published material, with a ball for each model that it was fitted with. */
function ballsOf(material, members) {
  const { presets, across } = session.hello;
  const ball = ([name, at]) =>
    element(
      "button",
      { class: "ball", "aria-label": name, onclick: () => choose({ type: "preset", name }, name) },
      ballOf("published", at, across, presets.length),
      name.slice(0, -material.length - 1),
    );
  return element("li", { class: "preset" }, element("b", {}, material.replaceAll("-", " ")), ...members.map(ball));
}

function choose(bsdf, name) {
  byId("add-dialog").close();
  addSubject(bsdf, name);
}

/** Arrow keys walk through what was found; Enter in the search field takes the first. */
function walk(event) {
  const items = [...byId("found").querySelectorAll("button")];
  const at = items.indexOf(document.activeElement);
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    event.preventDefault();
    const next = at + (event.key === "ArrowDown" ? 1 : -1);
    (next < 0 ? byId("search") : items[Math.min(next, items.length - 1)])?.focus();
  } else if (event.key === "Enter" && event.target === byId("search")) {
    event.preventDefault();
    items[0]?.click();
  }
}

// --- Files ----------------------------------------------------------------------------------------------------------

function startDrop() {
  const carriesFiles = (event) => !session.exported && [...(event.dataTransfer?.types ?? [])].includes("Files");
  let depth = 0;
  const tell = (inside) => document.documentElement.classList.toggle("dropping", inside);
  addEventListener("dragenter", (event) => carriesFiles(event) && tell(++depth > 0));
  addEventListener("dragleave", (event) => carriesFiles(event) && tell((depth = Math.max(depth - 1, 0)) > 0));
  addEventListener("dragover", (event) => carriesFiles(event) && event.preventDefault());
  addEventListener("drop", (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault();
    tell((depth = 0) > 0);
    uploadAll(event.dataTransfer.files);
  });
}

async function uploadAll(files) {
  byId("add-dialog").close();
  for (const file of files) {
    emit("busy", { text: `Uploading ${file.name} …` });
    try {
      const response = await fetch(`upload?${new URLSearchParams({ name: file.name })}`, {
        method: "POST",
        headers: { "Content-Type": "application/octet-stream" },
        body: file,
      });
      const answer = await response
        .json()
        .catch(() => ({ error: `The server refused ${file.name} (${response.status}).` }));
      if (answer.error) throw new Error(answer.error);
      if (answer.file) {
        session.hello.files = [...session.hello.files, answer];
        addSubject({ type: "tabulated", file: answer.file }, answer.name);
      } else if (answer.stage) {
        for (const words of ["stages", "turned"]) session.hello[words] = [...session.hello[words], answer.stage];
        change(answer);
      } else {
        session.hello.shapes = [...session.hello.shapes, answer.shape];
        change(answer);
      }
    } catch (error) {
      const isUnanswered = error instanceof TypeError;
      emit("error", {
        text: isUnanswered ? `${file.name} could not be sent: the server does not answer.` : error.message,
      });
    }
    emit("idle", {});
  }
}
