// The link to the server, see link.py.
//
//   send({ type: "seek", t: 1.25 })   sends a message; returns false while there is no connection
//   on("notice", (message) => ...)    is called for each message of this type from the server
//   on("open", () => ...)             is called whenever the connection is made, "close" when it is lost
const RETRY = 1000; // [ms] from a lost connection to the next attempt
const handlers = {};
let socket = null;

export function connect() {
  const address = new URL("/link", location.origin);
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address);
  socket.onopen = () => handle({ type: "open" });
  socket.onmessage = ({ data }) => handle(JSON.parse(data));
  socket.onclose = () => {
    handle({ type: "close" });
    setTimeout(connect, RETRY);
  };
}

function handle(message) {
  for (const handler of handlers[message.type] ?? []) handler(message);
}

export function send(message) {
  const open = socket?.readyState === WebSocket.OPEN;
  if (open) socket.send(JSON.stringify(message));
  return open;
}

export function on(type, handler) {
  (handlers[type] ??= []).push(handler);
}
