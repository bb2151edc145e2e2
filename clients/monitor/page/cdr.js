// ROS 2 messages out of their CDR bytes (little endian), and the car's own heartbeat. Everything is decoded into
// objects that are made once: a page that runs all day must not make garbage forty times a second.

const UTF8 = new TextDecoder();

/** Walks through one message. Alignment counts from the byte after the four of the encapsulation. */
export class Reader {
  /** Begins with a message: its bytes are view[start .. start + length). */
  begin(view, start, length) {
    this.view = view;
    this.origin = start + 4;
    this.at = this.origin;
    this.end = start + length;
    if (length < 4 || view.getUint8(start + 1) !== 1) throw new RangeError("not little-endian CDR");
  }

  align(size) {
    const off = (this.at - this.origin) % size;
    if (off) this.at += size - off;
  }

  u8() { return this.view.getUint8(this.at++); }
  u32() { this.align(4); const value = this.view.getUint32(this.at, true); this.at += 4; return value; }
  i32() { this.align(4); const value = this.view.getInt32(this.at, true); this.at += 4; return value; }
  f32() { this.align(4); const value = this.view.getFloat32(this.at, true); this.at += 4; return value; }
  f64() { this.align(8); const value = this.view.getFloat64(this.at, true); this.at += 8; return value; }

  /** Returns how many elements of so many bytes follow; a length that cannot be is refused before memory is taken. */
  count(bytesEach) {
    const count = this.u32();
    if (count * bytesEach > this.end - this.at) throw new RangeError("a sequence is longer than its message");
    return count;
  }

  skip(size, times, align) {
    if (!times) return;
    this.align(align);
    this.at += size * times;
  }

  text() {
    const length = this.count(1);
    const start = this.at;
    this.at += length;
    return length > 1 ? UTF8.decode(new Uint8Array(this.view.buffer, this.view.byteOffset + start, length - 1)) : "";
  }

  skipText() {
    const length = this.count(1);
    this.at += length;
  }

  /** Reads a header; returns its stamp in seconds since 1970. */
  stamp() {
    const seconds = this.i32();
    const nanoseconds = this.u32();
    this.skipText();
    return seconds + nanoseconds * 1e-9;
  }
}

const reader = new Reader();

/** sensor_msgs/LaserScan. ranges: metres, NaN where a beam has no distance. */
export class Scan {
  stamp = 0; angleMin = 0; step = 0; rangeMax = 0; n = 0;
  ranges = new Float32Array(0);

  read(view, start, length) {
    reader.begin(view, start, length);
    this.stamp = reader.stamp();
    this.angleMin = reader.f32();
    reader.f32();
    this.step = reader.f32();
    reader.skip(4, 3, 4);
    this.rangeMax = reader.f32();
    const n = reader.count(4);
    if (this.ranges.length < n) this.ranges = new Float32Array(n);
    reader.align(4);
    const { ranges } = this;
    for (let i = 0, at = reader.at; i < n; i++, at += 4) ranges[i] = view.getFloat32(at, true);
    this.n = n;
  }
}

/** visualization_msgs/MarkerArray: lines and points in base_link. `count` of `items` are in use. */
export class Markers {
  count = 0;
  items = [];

  read(view, start, length) {
    reader.begin(view, start, length);
    const count = reader.count(100);
    for (let i = 0; i < count; i++) {
      const item = this.items[i] ?? (this.items[i] = { name: "", n: 0, xy: new Float64Array(0) });
      readMarker(item);
    }
    this.count = count;
  }

  find(name) {
    for (let i = 0; i < this.count; i++) if (this.items[i].name === name) return this.items[i];
    return null;
  }
}

function readMarker(item) {
  reader.stamp();
  item.name = reader.text();
  reader.skip(4, 3, 4);
  reader.skip(8, 7 + 3, 8);
  reader.skip(4, 4 + 2, 4);
  reader.u8();
  const n = reader.count(24);
  if (item.xy.length < 2 * n) item.xy = new Float64Array(2 * n);
  for (let i = 0; i < n; i++) {
    item.xy[2 * i] = reader.f64();
    item.xy[2 * i + 1] = reader.f64();
    reader.f64();
  }
  item.n = n;
  reader.skip(4, 4 * reader.count(16), 4);
  reader.skipText();
  reader.stamp();
  reader.skipText();
  reader.skip(1, reader.count(1), 1);
  reader.skip(4, 2 * reader.count(8), 4);
  reader.skipText();
  reader.skipText();
  reader.skipText();
  reader.skip(1, reader.count(1), 1);
  reader.u8();
}

/** Reads a geometry_msgs/Pose in the plane. */
function readPose(into) {
  into.x = reader.f64();
  into.y = reader.f64();
  reader.skip(8, 3, 8);
  const z = reader.f64();
  const w = reader.f64();
  into.yaw = 2 * Math.atan2(z, w);
}

/** nav_msgs/Odometry, in the plane. */
export class Odometry {
  stamp = 0; x = 0; y = 0; yaw = 0; speed = NaN;

  read(view, start, length) {
    reader.begin(view, start, length);
    this.stamp = reader.stamp();
    reader.skipText();
    readPose(this);
    reader.skip(8, 36, 8);
    this.speed = reader.f64();
  }
}

/** geometry_msgs/PoseWithCovarianceStamped, in the plane. */
export class Pose {
  stamp = 0; x = 0; y = 0; yaw = 0;

  read(view, start, length) {
    reader.begin(view, start, length);
    this.stamp = reader.stamp();
    readPose(this);
  }
}

/** nav_msgs/OccupancyGrid. x, y, yaw: of the corner of the first cell. It comes again and again: the same one is kept. */
export class Grid {
  stamp = 0; cell = 0; width = 0; height = 0; x = 0; y = 0; yaw = 0;
  cells = new Int8Array(0);

  read(view, start, length) {
    reader.begin(view, start, length);
    const stamp = reader.stamp();
    if (stamp === this.stamp) return;
    reader.skip(4, 2, 4);
    this.cell = reader.f32();
    this.width = reader.u32();
    this.height = reader.u32();
    readPose(this);
    const count = reader.count(1);
    if (count !== this.width * this.height) throw new RangeError("a map of another size than it says");
    this.cells = new Int8Array(view.buffer.slice(view.byteOffset + reader.at, view.byteOffset + reader.at + count));
    this.stamp = stamp;
  }
}

const place = { x: 0, y: 0, yaw: 0 };

/** nav_msgs/Path whose stamps are the times of a lap. speed: from each point to the next one [m/s]. */
export class Path {
  stamp = 0; n = 0;
  xy = new Float64Array(0);
  speed = new Float64Array(0);

  read(view, start, length) {
    reader.begin(view, start, length);
    const stamp = reader.stamp();
    if (stamp === this.stamp) return;
    const n = reader.count(72);
    this.xy = new Float64Array(2 * n);
    this.speed = new Float64Array(n);
    for (let i = 0, lastS = 0; i < n; i++) {
      const atS = reader.i32() - Math.floor(stamp) + reader.u32() * 1e-9; // small numbers are exact
      reader.skipText();
      readPose(place);
      if (i) this.speed[i - 1] = Math.hypot(place.x - this.xy[2 * i - 2], place.y - this.xy[2 * i - 1]) / (atS - lastS);
      this.xy[2 * i] = place.x;
      this.xy[2 * i + 1] = place.y;
      lastS = atS;
    }
    this.n = n;
    this.stamp = stamp;
  }
}

/** ackermann_msgs/AckermannDriveStamped. */
export class Drive {
  stamp = 0; speed = NaN; steering = NaN;

  read(view, start, length) {
    reader.begin(view, start, length);
    this.stamp = reader.stamp();
    this.steering = reader.f32();
    reader.f32();
    this.speed = reader.f32();
  }
}

/** std_msgs/Float32. */
export class Float {
  value = NaN;

  read(view, start, length) {
    reader.begin(view, start, length);
    this.value = reader.f32();
  }
}

/** One JSON object. */
export class Json {
  value = null;

  read(view, start, length) {
    this.value = JSON.parse(UTF8.decode(new Uint8Array(view.buffer, view.byteOffset + start, length)));
  }
}

const BEAT_MAGIC = 0x31425257; // "WRB1", little endian
const BEAT_BYTES = 55;

/** The car's heartbeat (runtime/wire/teleop.py): what a page echoes so that its commands have an age. */
export class Beat {
  carSession = 0; number = 0; flags = 0; operatorName = "";
  #name = new Uint8Array(24);

  read(view, start, length) {
    if (length !== BEAT_BYTES || view.getUint32(start, true) !== BEAT_MAGIC) throw new RangeError("not a heartbeat");
    this.carSession = view.getUint32(start + 4, true);
    this.number = view.getUint32(start + 8, true);
    this.flags = view.getUint8(start + 12);
    this.#readName(view, start + 31);
  }

  get latched() { return (this.flags & 1) !== 0; }
  get present() { return (this.flags & 4) !== 0; }
  get lost() { return (this.flags & 8) !== 0; }

  #readName(view, start) {
    let changed = false;
    for (let i = 0; i < 24; i++) {
      const byte = view.getUint8(start + i);
      if (byte !== this.#name[i]) { this.#name[i] = byte; changed = true; }
    }
    if (!changed) return;
    const end = this.#name.indexOf(0);
    this.operatorName = UTF8.decode(this.#name.subarray(0, end < 0 ? 24 : end));
  }
}
