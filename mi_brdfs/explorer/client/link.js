// The connection to the server, or the frames that an exported page carries.
import { save } from "./util.js";
import { adopt, emit, session, stateForServer } from "./session.js";

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

function replay({ state, frames }) {
  document.documentElement.classList.add("exported");
  emit("exported", state);
  for (const frame of frames) {
    if (frame.header) {
      const bytes = Uint8Array.from(atob(frame.payload), (letter) => letter.charCodeAt(0));
      receivePayload(frame.header, bytes.buffer, 0);
    } else {
      const message = frame.text ?? frame;
      receive(typeof message === "string" ? JSON.parse(message) : message);
    }
  }
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
  const length = new DataView(buffer).getUint32(0, true);
  receivePayload(JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length))), buffer, 4 + length);
}

function receivePayload(header, buffer, offset) {
  if (header.type === "file") {
    save(header.name, new Uint8Array(buffer, offset), header.mime);
    emit("saved", header.name);
  } else if (header.type === "picture") {
    const pixels = new Uint8ClampedArray(buffer, offset, 4 * header.width * header.height);
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
