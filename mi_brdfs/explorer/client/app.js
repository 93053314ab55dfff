// The page: its cards, its bars, and what is drawn when.
import { byId, element, format } from "./util.js";
import { LIMITS, VIEWS, WORDS, change, clean, emit, fragment, goTo, on, readFragment, session, visible } from "./session.js";
import { connect, post, sendState } from "./link.js";
import { cards, makeCard } from "./card.js";
import { colourOf, isDark } from "./drawing.js";
import { AXES, drawAlbedo, drawCartesian, drawPolar, table } from "./plots.js";
import { drawSampler } from "./sampler.js";
import { drawMaps, mapsImage } from "./maps.js";
import { drawLobe, startLobe } from "./lobe.js";
import { drawPicture, pairOf, startPicture, wantedSize } from "./picture.js";
import { drawSubjects, startSubjects } from "./subjects.js";
import { startDialogs } from "./dialogs.js";
import { drawTour, startTours } from "./tour.js";

const TITLES = {
  picture: ["Picture", "", ["PNG"]],
  lobe: ["Lobe", "", ["PNG"]],
  polar: ["Plane of incidence, polar", "", ["SVG", "CSV"]],
  cartesian: ["Plane of incidence", "", ["SVG", "CSV"]],
  albedo: ["Albedo", "over the angle of incidence", ["SVG", "CSV"]],
  slice: ["Slice", "f over half and difference angle, φd = 90°", ["PNG"]],
  hemisphere: ["Hemisphere", "", ["PNG"]],
  sampler: ["Sampler", "", ["SVG", "CSV"]],
};
const DRAW = {
  picture: drawPicture,
  lobe: drawLobe,
  polar: drawPolar,
  cartesian: drawCartesian,
  albedo: drawAlbedo,
  slice: () => drawMaps("slice"),
  hemisphere: () => drawMaps("hemisphere"),
  sampler: () => drawSampler(chi2Box()),
};

/** What changes how the page shows what it has. */
const LOOKS = ["scale", "normalise", "dark", "lobes", "wire"];

// --- Drawing, once in a frame of the animation -----------------------------------------------------------------------

const stale = new Set();

/** Draw parts of the page in the next frame: views, "bars", "subjects", "tour". */
function redraw(...parts) {
  if (!stale.size) requestAnimationFrame(drawAll);
  for (const part of parts) stale.add(part);
}

function drawAll() {
  const parts = [...stale];
  stale.clear();
  for (const part of parts) {
    if (part in DRAW) {
      if (session.state.views.includes(part)) DRAW[part]();
    } else {
      ({ bars: drawBars, subjects: drawSubjects, tour: drawTour })[part]();
    }
  }
}

const redrawAll = () => redraw("bars", "subjects", "tour", ...VIEWS);

// --- Bars -----------------------------------------------------------------------------------------------------------

/** Tie a field to a name of the state. */
function tie(id, name, read = (field) => field.value, write = (field, value) => (field.value = value)) {
  const field = byId(id);
  const event = field.type === "range" || field.type === "checkbox" ? "input" : "change";
  field.addEventListener(event, () => change({ [name]: read(field) }));
  on("draw-bars", () => {
    const shown = session.state[name];
    if (document.activeElement !== field || field.type === "range" || field.type === "checkbox") write(field, shown);
  });
}

const asNumber = (field) => (Number.isFinite(field.valueAsNumber) ? field.valueAsNumber : 0);
const asFlag = (field) => field.checked;
const showFlag = (field, value) => (field.checked = value);

function startBars() {
  for (const [name, ...ids] of [
    ["theta", "theta-slider", "theta-field"],
    ["phi", "phi-slider", "phi-field"],
    ["exposure", "exposure-slider", "exposure-field"],
    ["turn", "turn"],
  ]) {
    for (const id of ids) {
      const [low, high] = LIMITS[name];
      byId(id).min ||= low;
      byId(id).max ||= high;
      tie(id, name, asNumber);
    }
  }
  for (const name of ["channel", "scale", "compare"]) setWords(name, WORDS[name], { side: "side by side" });
  setOptions(
    byId("axis"),
    WORDS.axis.map((word) => [word, AXES[word].symbol]),
  );
  for (const name of ["channel", "scale", "compare", "axis"]) tie(name, name);
  for (const name of ["stage", "shape"]) tie(name, name, ({ value }) => value || chooseFile(name));
  tie(
    "component",
    "component",
    ({ value }) => (value === "" ? null : Number(value)),
    (field, value) => (field.value = value ?? ""),
  );
  tie("normalise", "normalise", asFlag, showFlag);
  tie("cosine", "cosine", asFlag, showFlag);
  tie(
    "side",
    "lobes",
    ({ checked }) => (checked ? "side" : "over"),
    (field, value) => (field.checked = value === "side"),
  );
  tie("wire", "wire", asFlag, showFlag);
  for (const [at, id] of ["first", "second"].entries()) {
    byId(id).onchange = ({ target }) => {
      const pair = [...pairOf()];
      if (pair[1 - at] === Number(target.value)) pair[1 - at] = pair[at];
      pair[at] = Number(target.value);
      change({ pair });
    };
  }
  byId("swap").onclick = () => change({ pair: [...pairOf()].reverse() });
  byId("theme").onclick = () => change({ dark: !isDark() });
  byId("dismiss").onclick = () => (byId("alert").hidden = true);
  byId("views").replaceChildren(
    ...VIEWS.map((view) =>
      element(
        "button",
        {
          class: "toggle",
          "data-view": view,
          onclick: () => {
            change({ views: withOrWithout(session.state.views, view) });
          },
        },
        view,
      ),
    ),
  );
}

/** Ask for a file in place of a word, and meanwhile return the word that holds. */
function chooseFile(name) {
  byId("file").click();
  return (byId(name).value = session.state[name]);
}

/** Return views without one, or with it: in its usual place, or last where a tour has put them in another order. */
function withOrWithout(views, view) {
  if (views.includes(view)) return views.filter((each) => each !== view);
  const usual = VIEWS.filter((each) => views.includes(each)).join() === views.join();
  return usual ? VIEWS.filter((each) => each === view || views.includes(each)) : [...views, view];
}

const setOptions = (field, pairs) => {
  const told = JSON.stringify(pairs);
  if (field.dataset.told === told) return;
  field.dataset.told = told;
  field.replaceChildren(...pairs.map(([value, text]) => element("option", { value }, text)));
};

const setWords = (id, words, told = {}, ...more) =>
  setOptions(byId(id), [...words.map((word) => [word, told[word] ?? word]), ...more]);

function drawBars() {
  const { state, hello, info } = session;
  const own = session.exported ? [] : [["", "file …"]];
  setWords("stage", hello?.stages ?? [state.stage], { incidence: "from ωi" }, ...own);
  setWords("shape", hello?.shapes ?? [state.shape], { scene: hello?.scene }, ...own);
  byId("stage").parentElement.hidden = state.shape === "scene";
  byId("turn-row").hidden = !hello?.turned.includes(state.shape === "scene" ? "scene" : state.stage);
  setOptions(byId("component"), [
    ["", "all components"],
    ...(info[session.selected]?.components ?? []).map((name, k) => [k, name]),
  ]);
  byId("component-row").hidden = (info[session.selected]?.components ?? []).length < 2;
  emit("draw-bars");
  for (const button of byId("views").children) {
    const wanted = state.views.includes(button.dataset.view);
    button.setAttribute("aria-pressed", String(wanted));
    button.hidden = session.exported && !session.baked.includes(button.dataset.view);
    const { node } = cards[button.dataset.view];
    node.hidden = !wanted;
    node.style.order = state.views.indexOf(button.dataset.view);
  }
  const several = visible().length > 1;
  byId("compare-row").hidden = !several;
  byId("picture-bar").hidden = session.exported && !several;
  byId("pair-row").hidden = !several || state.compare === "side";
  const names = visible().map((k) => [k, state.subjects[k].name]);
  pairOf().forEach((k, at) => {
    const field = byId(["first", "second"][at]);
    setOptions(field, names);
    field.value = k;
  });
  byId("side-row").hidden = !several;
  if (state.dark === null) delete document.documentElement.dataset.dark;
  else document.documentElement.dataset.dark = state.dark;
  byId("theme").textContent = isDark() ? "Light" : "Dark";
  const told = state.subjects.map(({ name }) => name).join(", ");
  document.title = `${told || "Explorer"} · mi_brdfs`;
  if (session.exported) byId("version").textContent = `${told}: move a slider, turn the lobe, point at a curve`;
}

// --- The sampler's test ---------------------------------------------------------------------------------------------

const verdicts = [];

function chi2Box() {
  const row = (k) => {
    const test = () => {
      verdicts[k] = "testing …";
      post({ type: "chi2", subject: k });
      redraw("sampler");
    };
    const button = session.exported ? null : element("button", { onclick: test }, "χ² test");
    const { efficiency } = session.shown.sampler[k] ?? {};
    const told = [session.state.subjects[k].name];
    if (efficiency !== undefined) told.push(`efficiency η ${format(efficiency)}`);
    if (verdicts[k]) told.push(verdicts[k]);
    return element("p", { class: "marked", style: `--mark:${colourOf(k)}` }, button, ` ${told.join(": ")}`);
  };
  return element("div", { class: "verdicts" }, ...visible().map(row));
}

// --- Messages -------------------------------------------------------------------------------------------------------

function say(text) {
  byId("status").textContent = text;
  byId("status").hidden = !text;
}

function startMessages() {
  on("busy", ({ text }) => say(text));
  on("reloaded", () => (byId("alert").hidden = true));
  on("idle", () => say(""));
  on("error", (text) => {
    byId("alert-text").textContent = text;
    byId("alert").hidden = false;
  });
  on("chi2", ({ subject, passed, text }) => {
    verdicts[subject] = `${passed === undefined ? "" : passed ? "passed: " : "failed: "}${text}`;
    redraw("sampler");
  });
  on("connection", () => {
    byId("lost").hidden = session.connected;
    if (!session.connected) say("");
  });
}

// --- Life -----------------------------------------------------------------------------------------------------------

let address = "";
let timer = null;

/** Keep the state in the address: a step of the history for what is added or removed, else when it has settled. */
function keepAddress(push) {
  if (session.exported) return;
  clearTimeout(timer);
  const write = () => {
    address = fragment();
    if (address !== location.hash) history[push ? "pushState" : "replaceState"](null, "", address);
  };
  if (push) write();
  else timer = setTimeout(write, 250);
}

function openAddress() {
  if (location.hash === address) return;
  const found = readFragment(location.hash);
  if (!found) return;
  address = location.hash;
  goTo(found, false);
}

function start() {
  for (const view of VIEWS) {
    const card = makeCard(view, ...TITLES[view]);
    byId(view === "picture" ? "picture-place" : "grid").append(card.node);
    if (view === "slice" || view === "hemisphere") card.image = (done) => mapsImage(view).toBlob(done);
  }
  for (const view of ["polar", "cartesian", "albedo"]) cards[view].table = () => table(view);
  cards.sampler.table = () => [
    ["material", "theta_i_degrees", "efficiency"],
    ...visible().flatMap((k) =>
      (session.shown.sampler[k]?.eta.x ?? []).map((angle, at) => [
        session.state.subjects[k].name,
        angle,
        session.shown.sampler[k].eta.y[at],
      ]),
    ),
  ];
  cards.lobe.image = (done) => {
    drawLobe();
    cards.lobe.figure.querySelector("canvas")?.toBlob(done);
  };
  for (const view of ["picture", "lobe", "cartesian"]) cards[view].tools.before(byId(`${view}-bar`));
  startPicture();
  startLobe();
  startSubjects();
  startDialogs();
  startTours();
  startBars();
  startMessages();

  on("sending", () => (session.state.size = wantedSize()));
  on("state", (push, names) => {
    keepAddress(push);
    if (names?.every((name) => name === "wipe")) return redraw("picture");
    redrawAll();
    if (names?.every((name) => LOOKS.includes(name))) return;
    verdicts.length = 0;
    sendState();
  });
  on("selected", () => redraw("bars", "subjects"));
  on("subject", () => {
    say("");
    redraw("bars", "subjects", ...VIEWS);
  });
  on("view", (view) => {
    say("");
    redraw(view);
  });
  on("exported", (state) => {
    session.state = clean(state);
    redrawAll();
  });
  on("hello", () => {
    session.state = session.state.subjects.length
      ? clean(session.state)
      : (readFragment(location.hash) ?? clean(session.hello.state));
    if (!session.exported) emit("state", false);
    for (const id of ["tours", "share", "add"]) byId(id).disabled = false;
    byId("tours").hidden = !session.hello.tours?.length;
    byId("version").textContent = `${session.hello.version} · ${session.hello.variant}`;
  });
  // What is under a moving hand is drawn coarsely, and anew when the hand lets go.
  addEventListener("pointerdown", ({ target }) => (session.dragged = target.matches("input[type=range], .lobe canvas")));
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, () => {
      if (session.dragged) sendState();
      session.dragged = false;
    });
  }
  addEventListener("hashchange", openAddress);
  addEventListener("popstate", openAddress);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
  let width = innerWidth;
  const observer = new ResizeObserver(() => {
    if (session.hello && wantedSize() !== session.state.size) sendState();
    // Where the picture stays in sight on a phone, the bar above it does not.
    document.documentElement.style.setProperty("--above", `${byId("picture-bar").parentElement.offsetHeight + 12}px`);
    // There, the polar plot stays with it, in sight of the sliders.
    const before = cards[innerWidth > 700 ? "lobe" : "picture"].node;
    if (before.nextElementSibling !== cards.polar.node) {
      before.after(cards.polar.node);
      redraw("polar");
    }
    redraw("lobe");
    if (innerWidth > 700) byId("picture-bar").open = true;
    if (innerWidth !== width) redraw(...VIEWS);
    width = innerWidth;
  });
  for (const node of [document.body, byId("picture-bar")]) observer.observe(node);
  redrawAll();
  connect();
}

start();
