// node viewer.mjs RECORDING: read the channel for viewers as Foxglove does, with MCAP's own library for JavaScript.
//
// Foxglove decodes a channel of JSON if its schema is a JSON schema of an object whose properties each have one type. It
// plots numbers; a message that is not JSON is an error. Of the other channels only the encoding is read. Prints one JSON
// line: the encoding of each topic, the type of each plotted field, and the plotted messages.

import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import zstd from "@foxglove/wasm-zstd";

const PLOTTABLE = new Set(["number", "integer", "boolean"]);

async function readable(path) {
  const handle = await open(path);
  return {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      const part = new Uint8Array(Number(length));
      await handle.read(part, 0, Number(length), Number(offset));
      return part;
    },
    close: () => handle.close(),
  };
}

function typesOf(schema) {
  if (schema.encoding !== "jsonschema") throw new Error(`schema encoding ${schema.encoding}`);
  const root = JSON.parse(new TextDecoder().decode(schema.data));
  if (root.type !== "object") throw new Error(`a schema of type ${root.type}`);
  const types = Object.fromEntries(Object.entries(root.properties).map(([name, field]) => [name, field.type]));
  for (const [name, type] of Object.entries(types))
    if (!PLOTTABLE.has(type)) throw new Error(`the field ${name} of type ${type} is no curve`);
  return types;
}

await zstd.isLoaded;
const file = await readable(process.argv[2]);
const decompressHandlers = { zstd: (buffer, size) => zstd.decompress(buffer, Number(size)) };
const reader = await McapIndexedReader.Initialize({ readable: file, decompressHandlers });
const channels = [...reader.channelsById.values()];
const encodings = Object.fromEntries(channels.map((channel) => [channel.topic, channel.messageEncoding]));
const plot = channels.find((channel) => channel.topic === "/plot");
const types = typesOf(reader.schemasById.get(plot.schemaId));
const messages = [];
for await (const message of reader.readMessages({ topics: ["/plot"] }))
  messages.push({ time: message.publishTime.toString(), values: JSON.parse(new TextDecoder().decode(message.data)) });
await file.close();
console.log(JSON.stringify({ encodings, types, messages }));
