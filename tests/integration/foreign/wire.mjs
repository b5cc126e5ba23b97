// The messages of src/netboard/network/protocol/PROTOCOL.md (sections 2 and 11) as JavaScript objects.
//
// Every int is a BigInt (64 bits do not fit into a Number), every float a Number. Types are written as in the tables, but
// shorter: `float?` is "float or nil", `str*` "array of str", `(int,int)` "[int, int]", `map` "map of str to str".

import { decode as unpack, encode as pack } from "@msgpack/msgpack";

export const PROTOCOL_VERSION = 9n;

const TABLES = `
  1 Hello role:str side:str protocol:int name:str version:str details:map
  2 Welcome session:str protocol:int server_ns:int config:str
  3 Refusal reason:str
  4 Goodbye reason:str
  5 Ping sent_ns:int
  6 Pong ping_ns:int received_ns:int sent_ns:int
 10 Stylus seq:int stamp_ns:int x:float y:float z:float vx:float vy:float vz:float buttons:int safeguards:int
           rendered:float force_tick:int force_sent_ns:int force_received_ns:int sent_ns:int loop_ns:int
 11 Force tick:int sent_ns:int stylus_seq:int force:float lead_ns:int
 12 Heartbeat tick:int sent_ns:int stylus_seq:int lead_ns:int arm:bool
 13 Point tick:int sent_ns:int stylus_seq:int stamp_ns:int z:float vz:float k:float c:float lead_ns:int
 14 BackfillRequest first:int stop:int
 15 Backfill first:int next:int rows:bin
 20 View station:str tick:int sent_ns:int phase:str z:float theta:float p:float? target:float left:float? right:float?
         trial:int trials:int failures:int completion:float? best:float? notice:str seq:int share:float block:int
         blocks:int rest:float?
 21 Frames station:str shown:(int,int,int)* dropped:int
 22 QuestionnaireAnswers station:str block:int given:map seconds:float complete:bool
 30 LogRequest first:int
 31 LogBatch first:int lost:int records:bin*
 32 LogAck durable:int free_bytes:int file:str file_bytes:int
 33 LogEnd last:int
 34 TickRecord row:bin
 35 EventRecord seq:int tick:int time_ns:int name:str details:map
 36 ClockRecord seq:int peer:str t0_ns:int t1_ns:int t2_ns:int t3_ns:int offset_ns:int bound_ns:int drift_ppm:float
 37 FrameRecord seq:int station:str tick:int received_ns:int painted_ns:int dropped:int
 38 BackfillRecord seq:int side:str offset_ns:int rows:bin
 40 Trigger number:int tick:int tick_ns:int event:str code:int
 41 PulseReport number:int received_ns:int began_ns:int ended_ns:int edge_ns:int waited_ns:int fault:str
 42 InputPulse code:int time_ns:int
 43 BoxState ready:bool box:str simulated:bool reason:str
 50 Command name:str argument:str number:int
 51 StatusRequest
 52 Status session:str tick:int phase:str trial:int trials:int successes:int failures:int completions:float*
           late_ticks:int waiting_for:str* peers:str* notice:str
           links:(str,str,str,float,float,float,float,float,int)* loops:(str,float,float)*
           name:str dyad:str study:str pilot:bool consent:bool opened:bool armed:bool commander:str block:int blocks:int
           label:str condition:str rest:float pending:str outcomes:int recordings:(str,float,int,int)*
           stations:(str,float,int,float,int,int)* refused:(str,str,int)* lost:int* repeats:int*
           devices:(str,str,str,str,str)* displays:(str,str)* stand_ins:(str,bool)* ahead:str*
 53 Reply number:int accepted:bool reason:str
 54 OutcomesRequest first:int
 55 Outcomes first:int attempts:(int,int,int,str,float,str,int)*
 56 TraceRequest after:int
 57 Trace points:(int,float,float,float,float,float,float,float)*
 60 Move side:str delay:float duration:float displacement:float
 61 Pointer side:str z:float?
 62 Felt side:str force:float
 70 StationRequest action:str process:str
 71 StationReport side:str version:str machine:map processes:(str,str,int?,int,float,int)* logs:map refused:str
`;

const MESSAGES = TABLES.trim().split(/\n(?= *\d)/).map((entry) => {
  const [kind, name, ...fields] = entry.trim().split(/\s+/);
  return { kind: Number(kind), name, fields: fields.map((field) => field.split(":")) };
});
const BY_KIND = new Map(MESSAGES.map((message) => [message.kind, message]));
const BY_NAME = new Map(MESSAGES.map((message) => [message.name, message]));

const INT64 = { useBigInt64: true };
const FLOAT64 = { forceIntegerToFloat: true };
const IN_32_BITS = (value) => value >= -(2n ** 31n) && value < 2n ** 32n;

const must = (condition, value) => {
  if (!condition) throw new TypeError(`not what the table says: ${value}`);
  return value;
};

// How a value of each type is written, and how it is read from what MessagePack has made of it.
const SCALARS = {
  int: [(value) => (IN_32_BITS(value) ? pack(Number(value)) : pack(value, INT64)), BigInt],
  float: [(value) => pack(value, FLOAT64), (raw) => must(typeof raw === "number", raw)],
  bool: [(value) => pack(value), (raw) => must(typeof raw === "boolean", raw)],
  str: [(value) => pack(value), (raw) => must(typeof raw === "string", raw)],
  bin: [(value) => pack(value), (raw) => must(raw instanceof Uint8Array, raw)],
  map: [(value) => pack(value), (raw) => must(Object.values(raw).every((item) => typeof item === "string"), raw)],
};

const head = (count) => (count < 16 ? [0x90 | count] : [0xdc, count >> 8, count & 0xff]);
const array = (parts) => Buffer.concat([Buffer.from(head(parts.length)), ...parts]);

function write(type, value) {
  if (type.endsWith("?")) return value === null ? pack(null) : write(type.slice(0, -1), value);
  if (type.endsWith("*")) return array(value.map((item) => write(type.slice(0, -1), item)));
  if (type.startsWith("(")) return array(type.slice(1, -1).split(",").map((part, i) => write(part, value[i])));
  return SCALARS[type][0](value);
}

function read(type, raw) {
  if (type.endsWith("?")) return raw === null ? null : read(type.slice(0, -1), raw);
  if (type.endsWith("*")) return must(Array.isArray(raw), raw).map((item) => read(type.slice(0, -1), item));
  if (type.startsWith("(")) {
    const parts = type.slice(1, -1).split(",");
    must(raw.length === parts.length, raw);
    return parts.map((part, i) => read(part, raw[i]));
  }
  return SCALARS[type][1](raw);
}

/** The frame of a message, each number in its shortest form. */
export function encode(name, message) {
  const { kind, fields } = BY_NAME.get(name);
  return array([Buffer.from([kind]), ...fields.map(([field, type]) => write(type, message[field]))]);
}

/** The frame of a message of numbers only, each in its widest form: the "fixed form" of section 2. */
export function encodeFixed(name, message) {
  const { kind, fields } = BY_NAME.get(name);
  const start = [...head(fields.length + 1), kind];
  const frame = Buffer.alloc(start.length + 9 * fields.length);
  frame.set(start);
  fields.forEach(([field, type], i) => {
    const at = start.length + 9 * i;
    frame[at] = type === "int" ? 0xd3 : 0xcb;
    if (type === "int") frame.writeBigInt64BE(message[field], at + 1);
    else frame.writeDoubleBE(message[field], at + 1);
  });
  return frame;
}

/** The message of a frame, with its name as `is`; throws if it is none. */
export function decode(frame) {
  const raw = unpack(frame, INT64);
  const [kind, ...values] = must(Array.isArray(raw), raw);
  must(BY_KIND.has(kind), kind);
  const { name, fields } = BY_KIND.get(kind);
  must(values.length === fields.length, name);
  return { is: name, ...Object.fromEntries(fields.map(([field, type], i) => [field, read(type, values[i])])) };
}

/** The names and types of a message's fields, in order. */
export const fieldsOf = (name) => BY_NAME.get(name).fields;
