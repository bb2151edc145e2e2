// The messages of driving by hand, in JavaScript: docs/reference/topics.md has their bytes.
// Reads a beat from standard input and writes the command that answers it: node teleop_bytes.mjs SPEED STEERING
import { readFileSync } from "node:fs";

export function readBeat(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length !== 55 || bytes.toString("latin1", 0, 4) !== "WRB1") throw new Error("not a beat of this version");
  return {
    carSession: view.getUint32(4, true), beat: view.getUint32(8, true), flags: view.getUint8(12),
    operatorSession: view.getBigUint64(13, true), speedMps: view.getFloat32(27, true),
  };
}

export function writeCommand(session, sequence, beat, flags, speedMps, steeringRad, name) {
  const bytes = Buffer.alloc(60);
  bytes.write("WRC1", 0, "latin1");
  bytes.writeBigUInt64LE(session, 4);
  bytes.writeUInt32LE(sequence, 12);
  bytes.writeUInt32LE(beat.carSession, 16);
  bytes.writeUInt32LE(beat.beat, 20);
  bytes.writeUInt8(flags, 24); // 1: drive by hand, 0: everything is released
  bytes.writeUInt8(3, 25); // a script
  bytes.writeUInt16LE(0xffff, 26);
  bytes.writeFloatLE(speedMps, 28);
  bytes.writeFloatLE(steeringRad, 32);
  bytes.write(name, 36, 24, "utf8");
  return bytes;
}

const [speedMps, steeringRad] = process.argv.slice(2).map(Number);
process.stdout.write(writeCommand(7n, 1, readBeat(readFileSync(0)), 1, speedMps, steeringRad, "node"));
