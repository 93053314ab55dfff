// The page: its cards, its bars, and what is drawn when.
import { byId, element, phone, subscripted } from "./util.js";
import { LIMITS, VIEWS, WORDS, change, clean, emit, fragment, goTo, on, readFragment, session, visible } from "./session.js";
import { connect, sendState } from "./link.js";
import { cards, makeCard } from "./card.js";
import { isDark } from "./drawing.js";
import { AXES, curveTable, drawAlbedo, drawCartesian, drawPolar } from "./plots.js";
import { drawSampler, startSampler } from "./sampler.js";
import { drawMaps, mapsImage } from "./maps.js";
import { drawLobe, lobeImage, startLobe } from "./lobe.js";
import { drawPicture, pairOf, pictureImage, startPicture, wantedSize } from "./picture.js";
import { drawSubjects, startSubjects } from "./subjects.js";
import { startDialogs } from "./dialogs.js";
import { drawTour, startTours } from "./tour.js";

const CARDS = {
  picture: { title: "Picture", draw: drawPicture, image: pictureImage },
  lobe: { title: "Lobe", draw: drawLobe, image: lobeImage },
  polar: { title: "Plane of incidence, polar", draw: drawPolar, table: () => curveTable("polar") },
  cartesian: { title: "Plane of incidence", draw: drawCartesian, table: () => curveTable("cartesian") },
  albedo: {
    title: "Albedo",
    note: "over the angle of incidence",
    draw: drawAlbedo,
    table: () => curveTable("albedo"),
  },
  slice: {
    title: "Slice",
    note: "f over half and difference angle, φd = 90°",
    draw: () => drawMaps("slice"),
    image: () => mapsImage("slice"),
  },
  hemisphere: { title: "Hemisphere", draw: () => drawMaps("hemisphere"), image: () => mapsImage("hemisphere") },
  sampler: { title: "Sampler", draw: drawSampler, table: () => curveTable("sampler") },
};

/** The value of an option that asks for a file. */
const CHOOSE = "file …";

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
    if (part in cards) {
      if (session.state.views.includes(part)) cards[part].draw();
    } else {
      ({ bars: drawBars, subjects: drawSubjects, tour: drawTour })[part]();
    }
  }
}

const redrawAll = () => redraw("bars", "subjects", "tour", ...VIEWS);

// --- Bars -----------------------------------------------------------------------------------------------------------

/** Tie a field to the member of the state that its `data-member` names. */
function tie(field) {
  const { member } = field.dataset;
  const isMoved = field.type === "range" || field.type === "checkbox";
  const isNumber = member in LIMITS;
  if (isNumber && field.type !== "select-one") {
    const [low, high] = LIMITS[member];
    field.min ||= low;
    field.max ||= high;
  }
  const number = () => (field.value === "" ? null : Number(field.value));
  const chosen = () => (field.type === "checkbox" ? field.checked : isNumber ? number() : field.value);
  field.addEventListener(isMoved ? "input" : "change", () => {
    if (field.value === CHOOSE) chooseFile(field);
    else change({ [member]: chosen() });
  });
  on("draw-bars", () => {
    const shown = session.state[member];
    if (field.type === "checkbox") field.checked = shown;
    else if (isMoved || document.activeElement !== field) field.value = shown ?? "";
  });
}

function startBars() {
  for (const name of ["channel", "scale", "compare", "lobes"])
    setWords(name, WORDS[name], { side: "side by side", over: "overlaid" });
  setOptions(
    byId("axis"),
    WORDS.axis.map((word) => [word, AXES[word].symbol]),
  );
  for (const field of document.querySelectorAll("[data-member]")) tie(field);
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
          onclick: () => change({ views: withOrWithout(session.state.views, view) }),
        },
        view,
      ),
    ),
  );
}

/** Ask for a file in place of a word, which meanwhile holds. */
function chooseFile(field) {
  byId("file").click();
  field.value = session.state[field.dataset.member];
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
  const own = session.exported ? [] : [[CHOOSE, CHOOSE]];
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
  byId("lobes").hidden = !several;
  if (state.dark === null) delete document.documentElement.dataset.dark;
  else document.documentElement.dataset.dark = state.dark;
  byId("theme").textContent = isDark() ? "Light" : "Dark";
  const told = state.subjects.map(({ name }) => name).join(", ");
  document.title = `${told || "Explorer"} · mi_brdfs`;
  const moved = session.scrubbers.length > 1 ? "a slider" : "θi";
  const text = info.length ? `${told}: move ${moved}, turn the lobe, point at a curve` : "Loading …";
  if (session.exported) byId("version").replaceChildren(...subscripted(text));
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
  on("error", ({ text }) => {
    byId("alert-text").textContent = text;
    byId("alert").hidden = false;
  });
  on("connection", (connected) => {
    byId("lost").hidden = connected;
    if (!connected) say("");
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

function startListening() {
  on("sending", () => (session.state.size = wantedSize()));
  on("state", (push, names) => {
    keepAddress(push);
    if (names?.every((name) => name === "wipe")) return redraw("picture");
    redrawAll();
    if (names?.every((name) => LOOKS.includes(name))) return;
    emit("stale");
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
    emit("state", false);
    for (const id of ["tours", "share", "add"]) byId(id).disabled = false;
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
}

/** Arrange what has another place on a phone: there, pictures and polar plot stay in sight of the sliders, without the
 * bar of the pictures. */
function arrangeCards() {
  const { picture, lobe, polar } = cards;
  const bar = byId("picture-bar");
  bar.open = !phone.matches;
  if (phone.matches) byId("picture-place").before(bar);
  else picture.tools.before(bar);
  (phone.matches ? picture : lobe).node.after(polar.node);
}

function start() {
  for (const view of VIEWS) byId(view === "picture" ? "picture-place" : "grid").append(makeCard(view, CARDS[view]).node);
  for (const view of ["lobe", "cartesian"]) cards[view].tools.before(byId(`${view}-bar`));
  arrangeCards();
  phone.addEventListener("change", arrangeCards);
  for (const begin of [startPicture, startLobe, startSampler, startSubjects, startDialogs, startTours, startBars]) begin();
  startMessages();
  startListening();
  let width = innerWidth;
  new ResizeObserver(() => {
    if (session.hello && wantedSize() !== session.state.size) sendState();
    redraw(...(innerWidth === width ? ["lobe"] : VIEWS));
    width = innerWidth;
  }).observe(document.body);
  redrawAll();
  connect();
}

start();
