// The scene's frame: how long it is waited for, and what is kept over a reload of the page.
import assert from "node:assert/strict";
import { mock, test } from "node:test";

const opened = [];
const heard = {};
const kept = new Map([["seat", "the seat before"]]);
const frame = {
  contentWindow: { location: { replace: (address) => opened.push(String(address)) } },
  addEventListener: (type, handler) => (heard[type] = handler),
};
const loading = {};
const sockets = [];
class Socket {
  static OPEN = 1;
  readyState = 1;
  sent = [];
  constructor() {
    sockets.push(this);
  }
  send(text) {
    this.sent.push(JSON.parse(text));
  }
}
globalThis.WebSocket = Socket;
globalThis.location = { search: "?fixedDpr=0.2" };
globalThis.sessionStorage = {
  getItem: (key) => kept.get(key) ?? null,
  setItem: (key, value) => kept.set(key, value),
  removeItem: (key) => kept.delete(key),
};
globalThis.document = {
  baseURI: "http://localhost/",
  hidden: true,
  readyState: "complete",
  getElementById: () => frame,
  querySelector: () => loading,
};
const drawing = [];
globalThis.requestAnimationFrame = (callback) => drawing.push(callback);
globalThis.addEventListener = (type, handler) => (heard[type] = handler);
mock.timers.enable({ apis: ["setInterval", "setTimeout", "Date"] });
const link = await import("../../../web/page/shell/link.js");
const scene = await import("../../../web/page/shell/scene.js");

// What parts.js tells each second
function seconds(count, isConnected) {
  for (let k = 0; k < count; k++) {
    mock.timers.tick(1000);
    scene.heardOf(isConnected);
  }
}

test("the scene is opened once the first answer of the server is drawn", () => {
  scene.begin();
  seconds(2, false);
  assert.equal(opened.length, 0);
  while (drawing.length) drawing.pop()();
  assert.equal(opened.length, 1);
});

test("a document that still comes is waited for, however long it takes", () => {
  assert.match(opened[0], /scene\/[\w-]{24}\?darkMode=&fixedDpr=0.2$/);
  seconds(300, false);
  assert.equal(opened.length, 1);
  assert.equal(loading.hidden, false);
});

test("a scene that has come and gets no connection is opened again, at another seat, after ever longer times", () => {
  const before = scene.seat();
  heard.load();
  seconds(29, false);
  assert.equal(opened.length, 1);
  seconds(3, false);
  assert.equal(opened.length, 2);
  assert.notEqual(scene.seat(), before);
  heard.load();
  seconds(50, false);
  assert.equal(opened.length, 2);
  seconds(15, false);
  assert.equal(opened.length, 3);
});

test("a scene that loses its connection is opened again after some seconds", () => {
  heard.load();
  seconds(1, true);
  assert.ok(loading.hidden);
  seconds(7, false);
  assert.equal(opened.length, 3);
  seconds(4, false);
  assert.equal(opened.length, 4);
});

test("the seat is kept from a page's end to its next load, once", () => {
  link.connect();
  const [socket] = sockets;
  socket.onopen();
  const { sent } = socket;
  assert.deepEqual(sent, [{ type: "come_back", seat: "the seat before" }]);
  assert.equal(kept.size, 0);
  heard.pagehide();
  assert.equal(kept.get("seat"), scene.seat());
});
