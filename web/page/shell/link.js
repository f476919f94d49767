// The link to the server, see link.py.
//
//   send({ type: "seek", t: 1.25 })   sends a message, or tells that it is not sent; returns whether it is
//   isOpen()                          whether there is a connection
//   on("notice", (message) => ...)    is called for each message of this type from the server
//   on("open", () => ...)             is called whenever the connection is made, "close" when it is lost,
//                                     "unsent" when a message cannot be sent
const RETRY = 1000; // [ms] from a lost connection to the next attempt
const handlers = {};
let socket = null;

export function connect() {
  const address = new URL("link", document.baseURI); // a proxy may serve the page under a path
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

export const isOpen = () => socket?.readyState === WebSocket.OPEN;

export function send(message) {
  if (isOpen()) socket.send(JSON.stringify(message));
  else handle({ type: "unsent" });
  return isOpen();
}

export function on(type, handler) {
  (handlers[type] ??= []).push(handler);
}
