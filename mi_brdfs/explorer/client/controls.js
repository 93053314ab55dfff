// Controls of a subject's parameters, made from what the server declares of them.
import { block, byId, clamp, element, format, fromDisplay, onArrows, rgbOf, subscripted, toDisplay } from "./util.js";
import { changeSubject, session, setParameter } from "./session.js";
import { scrub } from "./link.js";

const STEPS = 1000;
let built = "";
let rows = [];

/** Show the controls of the selected subject; values that are being changed stay as they are. */
export function drawControls() {
  const k = session.selected;
  const info = session.info[k];
  const host = byId("controls");
  const told = byId("subject-error");
  if (!session.state.subjects[k]) {
    host.replaceChildren();
    told.textContent = built = "";
    return;
  }
  if (session.exported) return drawList(host, session.state.subjects[k].bsdf);
  const controls = info?.controls ?? [];
  const form = JSON.stringify([
    k,
    session.state.subjects[k].bsdf.type,
    controls.map(({ value, also, ...control }) => [control, isAbsent({ ...control, value }, k)]),
  ]);
  if (info && form !== built) {
    built = form;
    rows = controls.map((control) => makeRow(control, k));
    host.replaceChildren(...grouped(rows));
  }
  const own = rows.find(
    ({ control }) => info?.error && new RegExp(`(^|[^\\w])${control.name}([^\\w]|$)`).test(info.error),
  );
  told.textContent = info?.error && !own ? info.error : "";
  for (const row of rows) {
    const control = controls.find(({ name }) => name === row.control.name) ?? row.control;
    row.show(valueOf(control, k));
    row.error.textContent = row === own ? info.error : "";
  }
  byId("notes").textContent = (info?.notes ?? []).join(" · ");
}

/** Return the name of a parameter, whose lines end after underscores only. */
const nameOf = (name) =>
  element("code", {}, ...name.split(/(?<=_)/).flatMap((part, k) => (k ? [element("wbr"), part] : [part])));

/** In an exported page nothing can be changed: list the parameters, folded where there is little room. */
function drawList(host, bsdf) {
  const told = (value) => (typeof value === "number" ? format(value, 4) : String(value));
  const open = host.querySelector("details")?.open ?? innerWidth >= 900;
  const varied = session.scrubbers.map(({ name }) => name);
  const rows = Object.entries(bsdf)
    .filter(([name]) => name !== "type" && !varied.includes(name))
    .map(([name, value]) => [name, name === "file" ? value.replace(/^.*[\\/]/, "") : value])
    .map(([name, value]) =>
      block("fixed", nameOf(name), element("b", {}, Array.isArray(value) ? value.map(told).join(", ") : told(value))),
    );
  const list = block("list", ...rows);
  host.replaceChildren(element("details", { open }, element("summary", {}, "Parameters"), list));
}

/** Make the scrubbers of an exported page, each with its values listed. */
export function drawScrubbers() {
  byId("scrubbers").hidden = !session.scrubbers.length;
  if (byId("scrubbers").children.length !== session.scrubbers.length)
    byId("scrubbers").replaceChildren(...session.scrubbers.map(makeScrubber));
  session.scrubbers.forEach(({ values, at }, k) => {
    const [slider, told] = byId("scrubbers").children[k].querySelectorAll("input, output");
    slider.value = at;
    slider.setAttribute("aria-valuetext", format(values[at], 4));
    told.textContent = format(values[at], 4);
  });
}

function makeScrubber({ name, values }, k) {
  const id = `scrub-${name}`;
  const phi = session.state.phi ? `, φi = ${format(session.state.phi)}°` : "";
  const oninput = ({ target }) => scrub(k, Number(target.value));
  return block(
    "control",
    block(
      "name",
      element("label", { for: id }, ...(name === "theta" ? subscripted(`θi in degrees${phi}`) : [nameOf(name)])),
    ),
    block(
      "pair",
      element(
        "div",
        {},
        element("input", { type: "range", id, min: 0, max: values.length - 1, step: 1, oninput }),
        block("values", ...values.map((value) => element("span", {}, format(value, 4)))),
      ),
      element("output", { for: id }),
    ),
  );
}

/** Return the rows under the headings of their groups; those left out follow as buttons. */
function grouped(all) {
  const groups = new Map();
  for (const row of all) groups.set(row.control.group ?? "", [...(groups.get(row.control.group ?? "") ?? []), row]);
  return [...groups].flatMap(([name, members]) => {
    const absent = members.filter((row) => row.absent).map(({ node }) => node);
    return [
      name ? element("h3", {}, name) : null,
      ...members.filter((row) => !row.absent).map(({ node }) => node),
      absent.length ? block("row absent", ...absent) : null,
    ].filter(Boolean);
  });
}

/** Return what a parameter is set to, or else what the server says that it is. */
function valueOf({ name, value }, k) {
  return session.state.subjects[k].bsdf[name] ?? value ?? null;
}

/** Return whether a parameter is left out, by the page or, as far as that says nothing, by the server. */
const isAbsent = (control, k) => control.optional && valueOf(control, k) === null;

function makeRow(control, k) {
  const id = `control-${control.name}`;
  const now = () => session.info[k]?.controls.find(({ name }) => name === control.name) ?? control;
  const set = (value) => setParameter(k, now(), value);
  const absent = isAbsent(control, k);
  const error = element("p", { class: "error", id: `${id}-error`, role: "alert" });
  const described = { "aria-describedby": `${id}-error` };
  if (absent) {
    const usual = { number: middle, colour: () => 0.5, choice: ({ words }) => words[0], flag: () => true, text: () => "" };
    const node = element(
      "button",
      {
        class: "small",
        title: control.text ?? "",
        onclick: () => set(control.default ?? usual[control.kind](control)),
      },
      "+ ",
      nameOf(control.name),
    );
    return { control, node, absent, error, show: () => {} };
  }
  const make = { number: makeNumber, colour: makeColour, choice: makeChoice, flag: makeFlag, text: makeText }[
    control.kind
  ];
  const { body, show } = make(control, id, set, described);
  const act = control.optional ? "leave out" : "reset";
  const head = block(
    "name",
    element("label", { for: id, title: control.text ?? "" }, nameOf(control.name)),
    element(
      "button",
      { class: "quiet small reset", "aria-label": `${act} ${control.name}`, onclick: () => set(null) },
      act,
    ),
  );
  const meaning = control.text ? element("p", { class: "meaning" }, ...subscripted(control.text)) : null;
  return {
    control,
    node: block(`control ${control.kind}`, head, body, error, meaning),
    show,
    error,
  };
}

// --- Numbers --------------------------------------------------------------------------------------------------------

/** Return maps between a number and a slider's place in 0…1. */
function slide({ low, high, scale }) {
  if (scale !== "log") return [(value) => (value - low) / (high - low), (place) => low + place * (high - low)];
  const reach = Math.log(high / low);
  return [(value) => Math.log(Math.max(value, low) / low) / reach, (place) => low * Math.exp(place * reach)];
}

const middle = (control) => Number(slide(control)[1](0.5).toPrecision(2));
const rounded = (value) => Number(value.toPrecision(4));
const settled = (input, text) => {
  if (document.activeElement !== input) input.value = text;
};

/** Return a slider that gives what is chosen to `choose`, and what shows a number on it. Arrow keys move it by a
 * hundredth, with Shift by a thousandth. */
function makeSlider(control, id, described, choose) {
  const [place, value] = slide(control);
  const slider = element("input", { type: "range", id, min: 0, max: STEPS, step: 1, ...described });
  slider.oninput = () => choose(rounded(value(slider.value / STEPS)));
  onArrows(slider, (right, up, { shiftKey }) => {
    slider.value = Number(slider.value) + (right + up) * (shiftKey ? 1 : STEPS / 100);
    slider.oninput();
  });
  const show = (number) => {
    settled(slider, Math.round(clamp(place(number ?? 0), 0, 1) * STEPS));
    slider.setAttribute("aria-valuetext", format(number, 4));
  };
  return [slider, show];
}

const makeField = (attributes, choose) =>
  element("input", {
    type: "number",
    step: "any",
    ...attributes,
    onchange: ({ target }) => target.value !== "" && choose(target.valueAsNumber),
  });

function makeNumber(control, id, set, described) {
  const [slider, slideTo] = makeSlider(control, id, described, (chosen) => {
    field.value = chosen;
    set(chosen);
  });
  const field = makeField({ "aria-label": `${control.name}, as a number`, ...described }, set);
  const show = (given) => {
    const number = typeof given === "number" ? given : control.default;
    slideTo(number);
    settled(field, number == null ? "" : rounded(number));
  };
  return { body: block("pair", slider, field), show };
}

// --- Colours --------------------------------------------------------------------------------------------------------

const asColour = (value) => (Array.isArray(value) ? value : [value ?? 0, value ?? 0, value ?? 0]);
const byte = (value) => Math.round(255 * toDisplay(clamp(value, 0, 1)));
const hex = (colour) => "#" + colour.map((value) => byte(value).toString(16).padStart(2, "0")).join("");

/** A colour in linear rgb: a level for all three channels, a number for each, and a picker where they are in 0…1. */
function makeColour(control, id, set, described) {
  let current = asColour(control.value);
  const put = (colour) => {
    current = colour.map(rounded);
    set(current);
  };
  const [level, slideTo] = makeSlider(control, id, described, (wanted) => {
    const most = Math.max(...current);
    put(most > 0 ? current.map((value) => (value / most) * wanted) : [wanted, wanted, wanted]);
  });
  const picker = element("input", {
    type: "color",
    "aria-label": `${control.name}, as a colour`,
    oninput: () => put(rgbOf(picker.value).map(fromDisplay)),
  });
  const fields = ["red", "green", "blue"].map((channel, c) =>
    makeField({ "aria-label": `${control.name}, ${channel}`, class: channel }, (number) => put(current.with(c, number))),
  );
  const show = (given) => {
    current = asColour(given);
    slideTo(Math.max(...current));
    settled(picker, hex(current));
    fields.forEach((field, c) => settled(field, rounded(current[c])));
  };
  return {
    body: block("colours", block("pair", level, control.high <= 1 ? picker : null), block("three", ...fields)),
    show,
  };
}

// --- Words ----------------------------------------------------------------------------------------------------------

function makeChoice(control, id, set, described) {
  const select = element(
    "select",
    { id, ...described },
    ...control.words.map((word) => element("option", { value: word }, word)),
  );
  select.onchange = () => set(select.value);
  return { body: select, show: (value) => (select.value = value ?? control.default ?? "") };
}

function makeFlag(control, id, set, described) {
  const box = element("input", { type: "checkbox", id, ...described });
  box.onchange = () => set(box.checked);
  return { body: box, show: (value) => (box.checked = Boolean(value)) };
}

function makeText(control, id, set, described) {
  const field = element("input", { type: "text", id, spellcheck: "false", ...described });
  field.onchange = () => set(field.value || null);
  return { body: field, show: (value) => settled(field, value ?? "") };
}

/** Take out all parameters that have been set. */
export function resetAll() {
  const { bsdf } = session.state.subjects[session.selected];
  const kept = ["type", "name", "file"].filter((name) => name in bsdf);
  changeSubject(session.selected, { bsdf: Object.fromEntries(kept.map((name) => [name, bsdf[name]])) });
}
