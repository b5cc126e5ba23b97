// node golden.mjs FOLDER: read every golden frame, compare it with its JSON twin, write it again.
//
// Prints one JSON line per frame: its name, whether the message is the twin's and whether the bytes are the same again,
// and, for messages of numbers only, the frame in the fixed form. A twin gives NaN and infinities as strings and `bin` in
// hexadecimal digits; its integers are put in quotes before parsing, because a Number has no 64 bits.

import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { isDeepStrictEqual } from "node:util";
import { decode, encode, encodeFixed, fieldsOf } from "./wire.mjs";

const STRING_OR_NUMBER = /"(?:[^"\\]|\\.)*"|-?\d[\d.e+-]*/g;
const quoteNumbers = (text) => text.replace(STRING_OR_NUMBER, (found) => (found[0] === '"' ? found : `"${found}"`));

function value(type, json) {
  if (type.endsWith("?")) return json === null ? null : value(type.slice(0, -1), json);
  if (type.endsWith("*")) return json.map((item) => value(type.slice(0, -1), item));
  if (type.startsWith("(")) return type.slice(1, -1).split(",").map((part, i) => value(part, json[i]));
  const scalars = { int: BigInt, float: Number, bin: (digits) => new Uint8Array(Buffer.from(digits, "hex")) };
  return (scalars[type] ?? ((same) => same))(json);
}

const plain = (item) => (item instanceof Uint8Array ? new Uint8Array(item) : Array.isArray(item) ? item.map(plain) : item);

function check(path) {
  const frame = readFileSync(path);
  const twin = JSON.parse(quoteNumbers(readFileSync(path.replace(/bin$/, "json"), "utf8")));
  const { is, ...message } = decode(frame);
  const fields = fieldsOf(is);
  const expected = Object.fromEntries(fields.map(([field, type]) => [field, value(type, twin.fields[field])]));
  const read = Object.fromEntries(Object.entries(message).map(([field, item]) => [field, plain(item)]));
  const numeric = fields.length > 0 && fields.every(([, type]) => type === "int" || type === "float");
  return {
    equal: is === twin.message && isDeepStrictEqual(read, expected),
    identical: frame.equals(encode(is, message)),
    fixed: numeric ? encodeFixed(is, message).toString("hex") : null,
  };
}

const folder = process.argv[2];
for (const file of readdirSync(folder).filter((name) => name.endsWith(".bin")))
  console.log(JSON.stringify({ frame: file.slice(0, -4), ...check(join(folder, file)) }));
