// What the page shows: its state, the server's answers, and who listens.
import { PALETTE, clamp } from "./util.js";

const DECLARED = JSON.parse(document.getElementById("declared").textContent);
/** Views in their usual order, and the limits and words of members of the state, as the server declares them. */
export const { views: VIEWS, limits: LIMITS, words: WORDS } = DECLARED;
/** `own` are the members that the server needs not know. */
const { subjects: MOST_SUBJECTS, own: OWN, defaults: DEFAULTS } = DECLARED;

export const session = {
  state: structuredClone(DEFAULTS),
  serial: 0,
  /** Whether a hand moves a slider or the arrow of wi. */
  dragged: false,
  /** The subjects as they were sent. */
  sent: [],
  selected: 0,
  exported: document.getElementById("exported") !== null,
  /** What an exported page holds: its views, and its scrubbers with their places. */
  baked: [],
  scrubbers: [],
  hello: null,
  /** The server's account of each subject: error, controls, xml … */
  info: [],
  /** The latest answer of each view, by subject. */
  shown: Object.fromEntries(VIEWS.map((view) => [view, []])),
  /** For each subject the first state that it is in: answers to older ones are about another. */
  oldest: [],
};

const listeners = {};

export function on(event, listener) {
  (listeners[event] ??= []).push(listener);
}

export function emit(event, ...details) {
  for (const listener of listeners[event] ?? []) listener(...details);
}

/** Merge a patch into the state. `push` makes a step of the browser's history of it. */
export function change(patch, push = false) {
  session.state = clean({ ...session.state, ...patch });
  session.selected = clamp(session.selected, 0, Math.max(session.state.subjects.length - 1, 0));
  emit("state", push, Object.keys(patch));
}

/** Change a subject. */
export function changeSubject(index, patch) {
  change({ subjects: session.state.subjects.map((subject, k) => (k === index ? { ...subject, ...patch } : subject)) });
}

/** Set a parameter of a subject, or with null remove it: with it go those that it excludes, and come those that it
 * cannot be without. */
export function setParameter(index, { name, excludes = [], also = {} }, value) {
  const bsdf = { ...session.state.subjects[index].bsdf };
  for (const other of value === null ? [name, ...Object.keys(also)] : excludes) delete bsdf[other];
  if (value !== null) changeSubject(index, { bsdf: { ...also, ...bsdf, [name]: value } });
  else changeSubject(index, { bsdf });
}

/** Take the dict that the server made of a short one, unless it was changed meanwhile. */
export function adopt(index, bsdf) {
  const now = session.state.subjects[index]?.bsdf;
  if (bsdf && now && JSON.stringify(now) === JSON.stringify(session.sent[index]?.bsdf)) changeSubject(index, { bsdf });
}

/** Replace the subjects, each given with the number that it had, or -1; what the server has shown of them stays. */
function arrange(subjects, former, patch = {}, push = true) {
  const moved = (list) => former.map((k) => (k < 0 ? undefined : list[k]));
  session.info = moved(session.info);
  for (const view of Object.keys(session.shown)) session.shown[view] = moved(session.shown[view]);
  session.oldest = former.map((k, at) => (k === at ? session.oldest[k] : session.serial + 1));
  const place = session.state.pair.map((k) => former.indexOf(k));
  const pair = place.map((k, at) => (k >= 0 ? k : place[1 - at] === at ? 1 - at : at));
  change({ pair, ...patch, subjects }, push);
}

/** Go to another state, of a tour or an address. */
export function goTo(patch, push) {
  const told = ({ bsdf }) => JSON.stringify(bsdf);
  const now = session.state.subjects.map(told);
  const subjects = patch.subjects ?? session.state.subjects;
  if (patch.subjects) session.selected = 0;
  const free = new Set(now.keys());
  const former = subjects.map((subject, k) => {
    const found =
      now[k] === told(subject) && free.has(k) ? k : ([...free].find((at) => now[at] === told(subject)) ?? -1);
    free.delete(found);
    return found;
  });
  arrange(subjects, former, patch, push);
}

/** Return whether there is room for another subject. */
export const hasRoom = () => session.state.subjects.length < MOST_SUBJECTS;

/** Say that there is none, and what to do after removing a subject. */
export const tellFull = (then = "first") =>
  emit("error", { text: `There is room for ${MOST_SUBJECTS} materials: remove one ${then}.` });

export function addSubject(bsdf, name) {
  if (!hasRoom()) return tellFull();
  const { subjects } = session.state;
  const taken = subjects.map((subject) => subject.colour);
  const colour = [...PALETTE.keys()].find((k) => !taken.includes(k));
  session.selected = subjects.length;
  const patch = bsdf.type === "tabulated" ? { scale: "log" } : {}; // a measured paint is a flat line below a metal
  arrange([...subjects, { bsdf, name, hidden: false, colour }], [...subjects.keys(), -1], patch);
}

export function removeSubject(index) {
  const kept = [...session.state.subjects.keys()].filter((k) => k !== index);
  if (session.selected >= index) session.selected = Math.max(session.selected - 1, 0);
  arrange(
    kept.map((k) => session.state.subjects[k]),
    kept,
  );
}

/** Return the numbers of the subjects to be seen. */
export function visible() {
  return [...session.state.subjects.keys()].filter((k) => !session.state.subjects[k].hidden);
}

/** Return whether a value is of the kind of a usual one; none is of any. */
const isLike = (value, usual) =>
  usual === null ||
  (typeof value === typeof usual && Array.isArray(value) === Array.isArray(usual) && !Number.isNaN(value));

/** Return a state without what has no place in one: it may come from an address. */
export function clean(given) {
  const state = structuredClone(DEFAULTS);
  for (const [name, value] of Object.entries(given ?? {})) {
    if (!(name in DEFAULTS) || !isLike(value, DEFAULTS[name])) continue;
    if (!WORDS[name] || WORDS[name].includes(value)) state[name] = value;
  }
  state.subjects = state.subjects
    .slice(0, MOST_SUBJECTS)
    .filter((subject) => typeof subject?.bsdf?.type === "string")
    .map(({ bsdf, name, hidden, colour }, k) => ({
      bsdf,
      name: String(name ?? bsdf.name ?? bsdf.type),
      hidden: hidden === true,
      colour: Number.isInteger(colour) && colour in PALETTE ? colour : k,
    }));
  for (const name of ["stage", "shape"])
    if (session.hello && !session.hello[`${name}s`].includes(state[name])) state[name] = DEFAULTS[name];
  if (!Number.isInteger(state.component)) state.component = null;
  for (const [name, limits] of Object.entries(LIMITS))
    if (state[name] !== null) state[name] = clamp(state[name], ...limits);
  state.views = [...new Set(state.views)].filter((view) => VIEWS.includes(view));
  const last = Math.max(state.subjects.length - 1, 0);
  state.pair = [0, 1].map((k) => (Number.isInteger(state.pair[k]) ? clamp(state.pair[k], 0, last) : Math.min(k, last)));
  if (typeof state.dark !== "boolean") state.dark = null;
  if (typeof state.tour?.name !== "string") state.tour = null;
  return state;
}

/** Return the state without what is the page's own. */
export function stateForServer() {
  const sent = Object.fromEntries(Object.entries(session.state).filter(([name]) => !OWN.includes(name)));
  return { ...sent, dragged: session.dragged, subjects: sent.subjects.map(({ bsdf, hidden }) => ({ bsdf, hidden })) };
}

// --- The address ----------------------------------------------------------------------------------------------------

/** Return the fragment of the address: what differs from the defaults, as JSON in base64url, which mail programs and
 * chats leave as it is. */
export function fragment() {
  const told = Object.entries(session.state).filter(
    ([name, value]) => name !== "size" && JSON.stringify(value) !== JSON.stringify(DEFAULTS[name]),
  );
  const bytes = new TextEncoder().encode(JSON.stringify(Object.fromEntries(told)));
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return "#" + letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

function fromBase64url(letters) {
  const bytes = atob(letters.replaceAll("-", "+").replaceAll("_", "/"));
  return new TextDecoder().decode(Uint8Array.from(bytes, (letter) => letter.charCodeAt(0)));
}

/** Return the state that a fragment holds, in base64url or as plain JSON, or null. */
export function readFragment(text) {
  try {
    const plain = decodeURIComponent(text.replace(/^#/, ""));
    const found = JSON.parse(plain.startsWith("{") ? plain : fromBase64url(plain));
    return Array.isArray(found.subjects) ? clean(found) : null;
  } catch {
    return null;
  }
}
