// Listens to a console with the client library of foxglove.websocket.v1, and prints what the
// library makes of it, one line of JSON each:
//   node listen_foxglove.mjs MODULES URL TOPIC COUNT
// Subscribes to TOPIC and ends after COUNT of its messages.
import { createRequire } from "node:module";
import path from "node:path";

const [modules, url, topic, count] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, "nobody.js"));
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");

const tell = (line) => console.log(JSON.stringify(line));
const client = new FoxgloveClient({ ws: new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
let wanted;
let messages = 0;
client.on("error", (error) => {
  tell({ error: String(error.message ?? error) });
  process.exit(1);
});
client.on("serverInfo", ({ name, capabilities, sessionId }) =>
  tell({ serverInfo: { name, capabilities, hasSession: sessionId !== undefined } }));
client.on("status", ({ level, message }) => tell({ status: { level, message } }));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    tell({ channel });
    if (channel.topic === topic) wanted = client.subscribe(channel.id);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  if (subscriptionId !== wanted) return;
  tell({ timestamp: timestamp.toString(), bytes: Buffer.from(data.buffer, data.byteOffset, data.byteLength).toString("hex") });
  if (++messages < Number(count)) return;
  client.unsubscribe(wanted);
  client.close();
});
client.on("close", () => process.exit(messages === Number(count) ? 0 : 1));
