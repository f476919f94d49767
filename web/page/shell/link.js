// The link to the server, see link.py.
//
//   send({ type: "seek", t: 1.25 })   sends a message, or tells that it is not sent; returns whether it is
//   isOpen()                          whether there is a connection, over which the server was heard lately
//   on("notice", (message) => ...)    is called for each message of this type from the server
//   on("open", () => ...)             is called whenever the connection is made, "close" when it is lost,
//                                     "silent" when nothing came for some seconds, "heard" when something comes again,
//                                     and "unsent" when a message cannot be sent
const RETRY = 1000; // [ms] from a lost connection to the next attempt
// The server answers each second, see board.py. A network that is gone closes no connection.
const SILENCE = 6000; // [ms] without an answer after which the server counts as away
const LOST = 30000; // [ms] without an answer after which the connection is made anew
const handlers = {};
let socket = null;
let heard = 0; // when the last message came [ms]
let isSilent = false;

export function connect() {
  const address = new URL("link", document.baseURI); // a proxy may serve the page under a path
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address);
  socket.onopen = () => {
    [heard, isSilent] = [Date.now(), false];
    handle({ type: "open" });
  };
  socket.onmessage = ({ data }) => {
    heard = Date.now();
    listen();
    handle(JSON.parse(data));
  };
  socket.onclose = lose;
}

function lose() {
  socket.onclose = socket.onmessage = null;
  socket.close();
  handle({ type: "close" });
  setTimeout(connect, RETRY);
}

// Tell whether the server is heard. A hidden page asks nothing, and hears nothing.
function listen() {
  if (document.hidden) heard = Date.now();
  if (socket?.readyState !== WebSocket.OPEN) return;
  const silence = Date.now() - heard;
  if (isSilent !== silence > SILENCE) {
    isSilent = !isSilent;
    handle({ type: isSilent ? "silent" : "heard" });
  }
  if (silence > LOST) lose();
}
setInterval(listen, 1000);

function handle(message) {
  for (const handler of handlers[message.type] ?? []) handler(message);
}

export const isOpen = () => socket?.readyState === WebSocket.OPEN && !isSilent;

export function send(message) {
  if (isOpen()) socket.send(JSON.stringify(message));
  else handle({ type: "unsent" });
  return isOpen();
}

export function on(type, handler) {
  (handlers[type] ??= []).push(handler);
}
