// The connection to the server, or the frames that an exported page carries.
import { element, save } from "./util.js";
import { adopt, change, emit, session, setParameter, stateForServer } from "./session.js";

let socket = null;
let waiting = false;
let pause = 500;

/** Send the state once in this frame of the animation; nothing waits for an answer. */
export function sendState() {
  if (session.exported || waiting) return;
  waiting = true;
  const send = () => {
    waiting = false;
    emit("sending");
    if (!session.hello || !session.state.subjects.length) return;
    const state = stateForServer();
    session.sent = state.subjects;
    post({ type: "state", serial: ++session.serial, state });
  };
  if (document.hidden) setTimeout(send, 50);
  else requestAnimationFrame(send);
}

/** Send a message; return whether there is a connection. */
export function post(message) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(message));
  return true;
}

export function connect() {
  if (session.exported) return replay(JSON.parse(document.getElementById("exported").textContent));
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    pause = 500;
    session.connected = true;
    emit("connection");
  };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") receive(JSON.parse(data));
    else receiveBinary(data);
  };
  socket.onclose = () => {
    session.connected = false;
    emit("connection");
    setTimeout(connect, pause);
    pause = Math.min(2 * pause, 5000);
  };
}

let baked = [];

/** Unpack the frames of an exported page, and show those of the places where its scrubbers stand. */
async function replay({ state, scrubbers, views, frames, data }) {
  document.documentElement.classList.add("exported");
  session.scrubbers = scrubbers.map((scrubber) => ({ ...scrubber, at: scrubber.start }));
  session.baked = views;
  emit("exported", state);
  const zipped = new Blob([Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0))]).stream();
  const bytes = await new Response(zipped.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  let end = 0;
  baked = await Promise.all(
    frames.map(async ([at, length, isText]) => {
      const buffer = bytes.slice(end, (end += length));
      if (isText) return { at, message: JSON.parse(new TextDecoder().decode(buffer)) };
      const [header, offset] = opened(buffer);
      if (header.mime) header.pixels = await decoded(new Blob([new Uint8Array(buffer, offset)], { type: header.mime }));
      return { at, header, buffer, offset };
    }),
  );
  showBaked(() => true);
  session.scrubbers.forEach((_, k) => scrub(k, session.scrubbers[k].at));
}

async function decoded(blob) {
  const image = await createImageBitmap(blob);
  const { width, height } = image;
  const context = element("canvas", { width, height }).getContext("2d");
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, width, height).data;
}

function showBaked(concerned) {
  for (const { at, message, header, buffer, offset } of baked) {
    if (!concerned(at) || !at.every((place, k) => place === null || place === session.scrubbers[k].at)) continue;
    if (header) receivePayload(header, buffer, offset);
    else receive(structuredClone(message));
    if (message?.view === "polar" && session.state.axis === "theta_o") receive({ ...message, view: "cartesian" });
  }
}

/** Move a scrubber of an exported page to one of its values. */
export function scrub(k, at) {
  const { name, values } = Object.assign(session.scrubbers[k], { at });
  if (name === "theta") change({ theta: values[at] });
  session.state.subjects.forEach((_, subject) => {
    const control = session.info[subject]?.controls.find((each) => each.name === name && each.kind === "number");
    if (control) setParameter(subject, control, values[at]);
  });
  showBaked((places) => places[k] !== null);
}

/** Point wi to a direction, or in an exported page to the nearest one that it holds. */
export function aimAt(theta, phi) {
  if (!session.exported) return change({ theta, phi });
  const k = session.scrubbers.findIndex(({ name }) => name === "theta");
  const { values } = session.scrubbers[k];
  const off = values.map((value) => Math.abs(value - theta));
  scrub(k, off.indexOf(Math.min(...off)));
}

/** Keep an answer, unless a newer one is shown; return whether it was kept. */
function keep(view, subject, answer) {
  const list = session.shown[view];
  const before = list?.[subject];
  if (!list || subject >= session.state.subjects.length) return;
  if (answer.serial < session.oldest[subject] || answer.serial < before?.serial) return;
  // A part below the surface belongs to the part above it, or to the one before, until the next one has come.
  answer.former = before?.serial ?? 0;
  list[subject] = answer;
  emit("view", view.replace("Below", ""), subject);
}

function receive(message) {
  if (message.type === "hello") {
    session.hello = message;
    emit("hello");
  } else if (message.type === "subject") {
    if (message.serial < session.oldest[message.subject] || message.serial < session.info[message.subject]?.serial)
      return;
    session.info[message.subject] = message;
    emit("subject", message.subject);
    adopt(message.subject, message.bsdf);
  } else if (message.type === "view") {
    keep(message.view, message.subject, message);
  } else {
    emit(message.type, message.type === "error" ? message.text : message);
  }
}

function receiveBinary(buffer) {
  const [header, offset] = opened(buffer);
  receivePayload(header, buffer, offset);
}

/** Return the header of a binary frame, and where its payload begins. */
function opened(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  return [JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length))), 4 + length];
}

function receivePayload(header, buffer, offset) {
  if (header.type === "file") {
    save(header.name, new Uint8Array(buffer, offset), header.mime);
    emit("saved", header.name);
  } else if (header.type === "picture") {
    const pixels = header.pixels ?? new Uint8ClampedArray(buffer, offset, 4 * header.width * header.height);
    keep("picture", header.subject, { ...header, pixels });
  } else {
    const values = new Float32Array(buffer, offset);
    keep(header.type + (header.below ? "Below" : ""), header.subject, { ...header, values });
  }
}

/** Return the part below the surface that belongs to what is shown of a view, if there is one. */
export function belowOf(view, subject) {
  const above = session.shown[view][subject];
  const below = session.shown[view + "Below"][subject];
  return above && below && below.serial >= Math.min(above.former || above.serial, above.serial) ? below : null;
}
