// Close the hand and print touch, over WebSocket. Node 22 or later, or any browser:
//   node websocket_client.js ws://127.0.0.1:8766/TOKEN        (Node 20: node --experimental-websocket ...)
// The settings of the run need [websocket] with hand = true.
const url = globalThis.process?.argv[2] ?? new URLSearchParams(location.search).get("url");
const print = globalThis.print ?? console.log;
const socket = new WebSocket(url);
const firmest = 0.6; // touch, as a share of the calibrated press, at which the hand stops closing
let closure = 0;

socket.onmessage = ({ data }) => {
  const message = JSON.parse(data);
  if (message.type === "Welcome") {
    print(`TEGA ${message.tega}, may lead: ${message.allowed}`);
  } else if (message.type === "State" && message.t_ns !== null) {
    // 20 a second. A command names the newest t_ns that was received, so that TEGA knows how old it is.
    const touch = Math.max(0, ...Object.values(message.touch ?? {}));
    if (touch < firmest) closure = Math.min(1, closure + 0.02);
    socket.send(JSON.stringify({ type: "Hand", t_ns: message.t_ns, closure }));
    if (closure === 1) {
      socket.send(JSON.stringify({ type: "Mark", text: "closed" }));
      socket.send(JSON.stringify({ type: "Release" })); // the run holds, and opens the hand after safety.hold_ms
      socket.close();
    }
  } else if (message.type === "Record" && message.name === "Event") {
    print(`${message.topic} ${JSON.stringify(message.fields)}`);
  } else if (message.type === "Refused") {
    print(`refused: ${message.why}`);
  }
};
socket.onclose = ({ code }) => print(`closed with ${code}`);
socket.onerror = () => print("no connection: is the address right, with its token?");
