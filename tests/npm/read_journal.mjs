// Reads journals with the library of their own format, and prints one line of JSON for each file:
//   node read_journal.mjs MODULES FILE...
// MODULES is the folder node_modules. Messages are read twice: over the index, as tools seek, and
// from the front, as one reads a file without its end; samples are decoded with the schema that
// stands in the file and nothing else. CRCs are checked. Big integers become texts, NaN "NaN".
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";

const [modules, ...files] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, "nobody.js"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { parseIDL } = require("@foxglove/omgidl-parser");
const { MessageReader } = require("@foxglove/omgidl-serialization");

function plain(value) {
  if (typeof value === "bigint") return value.toString();
  if (typeof value === "number") return Number.isFinite(value) ? value : String(value);
  if (ArrayBuffer.isView(value) || Array.isArray(value)) return Array.from(value, plain);
  if (typeof value !== "object" || value === null) return value;
  return Object.fromEntries(Object.entries(value).map(([name, field]) => [name, plain(field)]));
}

class Decoder {
  #schemas = new Map();
  #channels = new Map();
  #readers = new Map();

  learn(record) {
    if (record.type === "Schema") this.#schemas.set(record.id, record);
    if (record.type === "Channel") this.#channels.set(record.id, record);
  }

  decoded(message) {
    const channel = this.#channels.get(message.channelId);
    const schema = this.#schemas.get(channel.schemaId);
    const facts = {
      topic: channel.topic,
      type: schema?.name,
      sequence: message.sequence,
      log_time: message.logTime.toString(),
      publish_time: message.publishTime.toString(),
    };
    if (schema?.encoding !== "omgidl" || channel.messageEncoding !== "cdr") {
      return { ...facts, text: new TextDecoder().decode(message.data) };
    }
    if (!this.#readers.has(schema.id)) {
      const definitions = parseIDL(new TextDecoder().decode(schema.data));
      this.#readers.set(schema.id, new MessageReader(schema.name, definitions));
    }
    return { ...facts, value: plain(this.#readers.get(schema.id).readMessage(message.data)) };
  }
}

async function overTheIndex(bytes) {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const decoder = new Decoder();
  for (const schema of reader.schemasById.values()) decoder.learn(schema);
  for (const channel of reader.channelsById.values()) decoder.learn(channel);
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    messages.push(decoder.decoded(message));
  }
  const counted = reader.statistics?.messageCount;
  if (counted !== BigInt(messages.length)) throw new Error(`statistics count ${counted} messages`);
  return messages;
}

function fromTheFront(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true });
  const decoder = new Decoder();
  const messages = [];
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) {
    decoder.learn(record);
    if (record.type === "Message") messages.push(decoder.decoded(record));
  }
  return { messages, done: reader.done() };
}

async function attempt(read) {
  try {
    return await read();
  } catch (error) {
    return { error: String(error) };
  }
}

for (const file of files) {
  const bytes = new Uint8Array(readFileSync(file));
  const line = {
    file,
    indexed: await attempt(() => overTheIndex(bytes)),
    streamed: await attempt(() => fromTheFront(bytes)),
  };
  console.log(JSON.stringify(line));
}
