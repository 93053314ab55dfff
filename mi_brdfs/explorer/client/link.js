// The connection to the server, or the frames that an exported page carries.
import { element } from "./util.js";
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
    emit("connection", true);
  };
  socket.onmessage = ({ data }) => receive(unpacked(data));
  socket.onclose = () => {
    emit("connection", false);
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
      const message = unpacked(isText ? new TextDecoder().decode(buffer) : buffer);
      if (message.type === "picture") message.pixels = await decoded(new Blob([message.pixels], { type: message.mime }));
      return { at, message };
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
  for (const { at, message } of baked) {
    if (!concerned(at) || !at.every((place, k) => place === null || place === session.scrubbers[k].at)) continue;
    receive(message);
    if (message.view === "polar" && session.state.axis === "theta_o") receive({ ...message, view: "cartesian" });
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

/** Return the message of a frame: JSON, or the length of a header, the header and bytes, which are the values of its
 * parts, the pixels of a picture or a file. */
function unpacked(frame) {
  if (typeof frame === "string") return JSON.parse(frame);
  const start = 4 + new DataView(frame).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, start - 4)));
  if (message.type === "file") return { ...message, data: new Uint8Array(frame, start) };
  if (message.type === "picture") return { ...message, pixels: new Uint8ClampedArray(frame, start) };
  let at = start;
  for (const part of message.parts) {
    part.values = new Float32Array(frame, at, part.size);
    at += part.values.byteLength;
  }
  return message;
}

/** Take a message. What is older than what is shown of a subject is about another state. */
function receive(message) {
  const { type, view = type, subject, serial } = message;
  if (type === "hello") session.hello = message;
  if (serial === undefined) return emit(type, message);
  const list = type === "subject" ? session.info : session.shown[view];
  if (serial < session.oldest[subject] || serial < list[subject]?.serial) return;
  list[subject] = message;
  if (type !== "subject") return emit("view", view);
  emit("subject");
  adopt(subject, message.bsdf);
}
