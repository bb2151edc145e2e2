// The page: everything below meets here.

import { Calibration } from "./controls/calibration.js";
import { Condition, showCars } from "./condition.js";
import { Device } from "./device.js";
import { Driving } from "./controls/driving.js";
import { Fleet } from "./fleet.js";
import { Hands } from "./controls/hands.js";
import { LapMap } from "./controls/lap_map.js";
import { Laps } from "./laps.js";
import { Link } from "./link.js";
import { $, age, announce, number, setData, setHidden, setText } from "./look.js";
import { MuxView } from "./mux.js";
import { PilotView } from "./controls/pilot_view.js";
import { Plots } from "./plots.js";
import { RecordButton } from "./controls/record_button.js";
import { remember } from "./remembered.js";
import { Scene } from "./scene.js";
import { Settings } from "./settings.js";
import { Simulator } from "./simulator.js";
import { StopButton } from "./controls/stop_button.js";
import { Timings } from "./timings.js";

const OLD_MS = 500;
const AGES_MS = 100;

const link = new Link();
const scene = new Scene($("scene"), link);
const plots = new Plots($("strips"));
const mux = new MuxView();
const device = new Device();
const condition = new Condition(link, device, () => settings.refresh());
const timings = new Timings();
const remembered = remember();
const hands = new Hands(link, { onStop: () => stopButton.stop(), onChange: () => driving.show() });
const driving = new Driving(hands, remembered.share);
const pilotView = new PilotView(link, hands, device);
const settings = new Settings(link, (car) => {
  scene.lidar = { x: car["car.lidar_x_m"] ?? scene.lidar.x, y: car["car.lidar_y_m"] ?? 0 };
});
const simulator = new Simulator(link);
const fleet = new Fleet(link, openCar);
const stopButton = new StopButton({ link, fleet, device, timings });
const recordButton = new RecordButton(link);
const calibration = new Calibration(link, hands);
const lapMap = new LapMap(link);
const laps = new Laps();
let car = "";
let watched = ""; // the last one, also while all are shown
let carSession = 0;
let wanted = ""; // the car to show next
let all = false; // shows all cars instead of one
let frameAsked = false;

// --- drawing: once per frame, and only when there is something new ---------------------------------------------

function wantFrame() {
  if (frameAsked || document.hidden) return;
  frameAsked = true;
  requestAnimationFrame(frame);
}

function frame() {
  frameAsked = false;
  const nowMs = performance.now();
  if (scene.dirty) {
    scene.draw(nowMs);
    timings.drawn();
  }
  plots.draw(nowMs);
}

/** What is done with a topic's newest message; ms: when it left the car, on this page's clock. */
const TAKE = {
  scan({ stamp }) { timings.received(stamp); scene.dirty = true; },
  wall() { scene.dirty = true; },
  footprint(markers, ms) { scene.takeFootprint(markers, ms); scene.dirty = true; },
  pose(pose, ms) { scene.course.takePose(pose); scene.takePlace(pose, true, ms); },
  odom(odometry, ms) { scene.takePlace(odometry, false, ms); plots.push(plots.speed, 2, ms, odometry.speed); },
  output({ speed, steering }, ms) { plots.push(plots.speed, 1, ms, speed); plots.pushSteering(ms, steering); },
  distance_error({ value }, ms) { plots.push(plots.error, 0, ms, value); },
  decision({ value }, ms) { plots.push(plots.speed, 0, ms, value.asked_mps ?? NaN); },
  status({ value }, ms) { takeStatus(value, ms); },
  beat: takeBeat,
  pilot({ value }) { pilotView.show(value); },
  monitor({ value }) { takeMonitor(value); },
  fleet({ value }) { fleet.show(value); },
  calibration({ value }) { calibration.show(value); },
  lap_map({ value }) { lapMap.show(value); },
};

function takeNews(topic) {
  TAKE[topic]?.(link.newest[topic], link.seenMs[topic]);
  wantFrame();
}

function takeStatus(status, nowMs) {
  condition.showStatus(status);
  scene.takeWindow(status.window ?? []);
  scene.course.takeStatus(status.pose ?? {});
  laps.take(status.pose?.race);
  lapMap.showSense();
  mux.show(status, link.ageMs("decision") < OLD_MS ? link.newest.decision.value : null);
  plots.push(plots.latency, 0, nowMs, status.scan_to_motor_ms?.p99 ?? NaN);
  const measured = status.speed_mps;
  setText($("speed"), number(measured, 2));
  setText($("distance-error"), number(status.distance_error?.mean_abs_m * 100, 1, " cm"));
  recordButton.show(status.recording);
}

function takeBeat(beat) {
  if (carSession && beat.carSession !== carSession) {
    announce("the car's program has restarted");
    scene.forgetWay();
    settings.refresh();
    simulator.refresh();
  }
  carSession = beat.carSession;
  setData(document.body, "latched", String(beat.latched));
}

function takeMonitor(monitor) {
  showCars($("car"), monitor.cars, car);
  setHidden($("all-cars"), all || monitor.cars.length < 2);
  if (all) return;
  if (!car && monitor.cars.length) watch(monitor.cars.includes(remembered.car) ? remembered.car : monitor.cars[0]);
  plots.push(plots.latency, 1, performance.now(), monitor.round_trip_s === null ? NaN : monitor.round_trip_s * 1000 + link.roundTripMs);
}

/** Runs without news too: what is old must look old. */
function showAges() {
  const nowMs = performance.now();
  const scanMs = link.ageMs("scan", nowMs), statusMs = link.ageMs("status", nowMs);
  showAge($("view"), scanMs);
  showAge($("mux"), statusMs);
  showAge($("condition"), statusMs);
  showAge($("plots"), Math.min(scanMs, statusMs));
  setData(document.body, "linked", String(all ? fleet.isFresh : link.open && link.ageMs("beat", nowMs) < OLD_MS));
  fleet.showAges();
  setData(document.body, "old", String(!link.open || statusMs > OLD_MS));
  condition.showAges(link.newest.monitor.value, nowMs);
  if (link.open && link.ageMs("pilot", nowMs) > OLD_MS) pilotView.showNone();
  stopButton.show(nowMs);
  driving.pad.draw();
  wantFrame();
}

function showAge(panel, ms) {
  const old = !link.open || ms > OLD_MS;
  setData(panel, "old", String(old));
  setText(panel.querySelector(".old"), !old ? "" : Number.isFinite(ms) ? `${age(ms)} old` : "nothing heard yet");
}

// --- the rest ---------------------------------------------------------------------------------------------------

$("car").addEventListener("change", () => watch($("car").value));
$("zoom-in").addEventListener("click", () => { scene.zoom(1); wantFrame(); });
$("zoom-out").addEventListener("click", () => { scene.zoom(-1); wantFrame(); });
for (const button of document.querySelectorAll("#windows button")) {
  button.addEventListener("click", () => {
    plots.windowMs = Number(button.value) * 1000;
    remember({ window: button.value });
    showWindow(button.value);
    wantFrame();
  });
}

function showWindow(value) {
  for (const button of document.querySelectorAll("#windows button")) button.setAttribute("aria-pressed", String(button.value === value));
}

/** Shows all cars, or the chosen one; the address says which, so that the browser's Back works. */
function showView() {
  const before = all;
  stopButton.all = all = location.hash === "#all";
  setData(document.body, "view", all ? "all" : "car");
  setHidden($("fleet"), !all);
  setHidden($("all-cars"), all || (link.newest.monitor.value?.cars.length ?? 0) < 2);
  setText($("stop-word"), all ? "STOP ALL" : "STOP");
  $("stop").setAttribute("aria-describedby", "stop-note");
  if (all === before) return;
  if (all) lookAtAll();
  else if (wanted) watch(wanted);
  else if (link.newest.monitor.value) takeMonitor(link.newest.monitor.value);
  wanted = "";
}

function lookAtAll() {
  hands.engage(false);
  car = "";
  link.forgetCar();
  link.forget("fleet");
  link.say({ t: "all" });
  document.title = "all cars · wallride";
}

function openCar(name) {
  wanted = name;
  location.hash = "";
}

function watch(name) {
  if (name === car) return;
  hands.engage(false);
  const first = !watched;
  watched = car = name;
  carSession = 0;
  remember({ car });
  remembered.car = car;
  link.forgetCar();
  if (!first) plots.clear();
  scene.forgetWay();
  laps.forget();
  settings.forget();
  simulator.forget();
  link.say({ t: "watch", car });
  document.title = `${car} · wallride`;
  setTimeout(() => { settings.refresh(); simulator.refresh(); }, 400);
}

link.on("hello", (hello) => {
  driving.takeTopSpeed(hello.top_speed_mps);
  if (all) lookAtAll();
  else if (car) link.say({ t: "watch", car });
  else if (hello.car) { showCars($("car"), hello.cars, hello.car); watch(hello.car); }
  else takeMonitor(hello);
  stopButton.sendOwed();
  setText($("you"), `You are ${hello.name}.`);
});
link.on("history", (message) => {
  if (message.car !== car) return;
  plots.fill(message.lines, performance.now());
  wantFrame();
});
link.on("gone", () => {
  announce(link.goodbye || "the link to the monitor broke; trying again", "bad");
  pilotView.showNone();
});
link.on("trouble", (reason) => announce(reason, "bad"));
link.on("news", takeNews);
document.addEventListener("visibilitychange", () => { scene.dirty = true; wantFrame(); });
window.addEventListener("resize", () => { scene.dirty = true; wantFrame(); });

$("new-race").addEventListener("click", () => { link.say({ t: "new_race" }); announce("A new race: laps count from where each car stands.", "good"); });
window.addEventListener("hashchange", showView);
showView();

const windowChoice = remembered.window ?? "30";
plots.windowMs = Number(windowChoice) * 1000;
showWindow(windowChoice);
driving.show();
device.look(hands.pads);
pilotView.showDevice();
setHidden($("noscript"), true);
setInterval(showAges, AGES_MS);
link.connect();

/** For measurements and tests; nothing on the page depends on it. */
window.wallride = { link, fleet, scene, plots, hands, timings, get car() { return car; } };
