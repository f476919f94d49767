// The link to the server for what viser's own controls do not carry, see link.py.
//
//   race.send({ type: "seek", t: 1.25 })   sends a message; returns false while there is no connection
//   race.on("notice", (message) => ...)    is called for each message of this type from the server
//   race.on("open", () => ...)             is called whenever the connection is made
//
// An element of the page with an attribute data-send, which holds a message as JSON, sends it when it is pressed.
window.race = (() => {
  const RETRY = 1000; // [ms] from a lost connection to the next attempt
  const handlers = {};
  let socket = null;

  function connect() {
    const address = new URL("link", location.href.split("?")[0]);
    address.protocol = address.protocol.replace("http", "ws");
    socket = new WebSocket(address);
    socket.onopen = () => handle({ type: "open" });
    socket.onmessage = ({ data }) => handle(JSON.parse(data));
    socket.onclose = () => setTimeout(connect, RETRY);
  }

  function handle(message) {
    for (const handler of handlers[message.type] ?? []) handler(message);
  }

  function send(message) {
    const open = socket?.readyState === WebSocket.OPEN;
    if (open) socket.send(JSON.stringify(message));
    return open;
  }

  function on(type, handler) {
    (handlers[type] ??= []).push(handler);
  }

  addEventListener("DOMContentLoaded", () => {
    connect();
    document.body.addEventListener("click", (event) => {
      const pressed = event.target.closest("[data-send]");
      if (pressed) send(JSON.parse(pressed.dataset.send));
    });
  });
  return { send, on };
})();
