// The link to a server that falls silent, as it does when a network is gone and no connection is closed.
import assert from "node:assert/strict";
import { mock, test } from "node:test";

const sockets = [];
class Socket {
  static OPEN = 1;
  constructor() {
    this.readyState = 0;
    this.sent = [];
    sockets.push(this);
  }
  open() {
    this.readyState = Socket.OPEN;
    this.onopen();
  }
  say(message) {
    this.onmessage({ data: JSON.stringify(message) });
  }
  send(text) {
    this.sent.push(JSON.parse(text));
  }
  close() {
    this.readyState = 3;
  }
}
globalThis.WebSocket = Socket;
globalThis.document = { baseURI: "http://localhost/", hidden: false };
mock.timers.enable({ apis: ["setInterval", "setTimeout", "Date"] });
const link = await import("../../../web/page/shell/link.js");

const told = [];
for (const type of ["open", "close", "silent", "heard", "unsent"]) link.on(type, () => told.push(type));
const seconds = (count) => {
  for (let k = 0; k < count; k++) mock.timers.tick(1000);
};

test("a server that is not heard counts as away, and gets nothing that a visitor asks for", () => {
  link.connect();
  const [socket] = sockets;
  socket.open();
  assert.ok(link.send({ type: "start" }));
  seconds(4);
  socket.say({ type: "parts" });
  seconds(5);
  assert.deepEqual(told.splice(0), ["open"]);
  seconds(3);
  assert.equal(link.send({ type: "start" }), false);
  assert.deepEqual(told.splice(0), ["silent", "unsent"]);
  assert.equal(socket.sent.length, 1);
  socket.say({ type: "parts" });
  assert.ok(link.isOpen());
  assert.deepEqual(told.splice(0), ["heard"]);
});

test("a connection that stays silent is made anew, and the old one is not heard", () => {
  seconds(40);
  assert.deepEqual(told.splice(0), ["silent", "close"]);
  assert.equal(sockets.length, 2);
  assert.equal(sockets[0].onmessage, null);
  sockets[1].open();
  assert.deepEqual(told.splice(0), ["open"]);
});

test("a page that is hidden asks nothing, so it does not wait for the server", () => {
  document.hidden = true;
  seconds(60);
  document.hidden = false;
  seconds(3);
  assert.deepEqual(told.splice(0), []);
});
