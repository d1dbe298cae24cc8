// Plays finished tests in the browser. What is shown comes from the server; which test, when and how fast is the reader's own choice.
"use strict";

const STEP = 0.1; // between two rows of a recording, s
const PAUSE = 2; // at the end, before it plays again, s
const SLOW = 1 / 30; // a picture that takes longer, s, is drawn with less: without shadows, then with fewer pixels
const SHARE = [1, 1, 0.7, 0.5]; // of the pixels along a side
const LOOKS = 12; // pictures between two such decisions, or fewer that take
const LATEST = 0.5; // s together
const place = (id) => document.getElementById(id);
const viewer = new MeshCat.Viewer(place("picture"));
const node = (...path) => viewer.scene_tree.find(["world", ...path]).object;
const home = () => viewer.scene_tree.find(["world"]).object.position;

let said = {}; // the last words of the server
let chosen = false; // whether the reader has chosen what to see
let play = null, ghost = null, pair = null; // the test, the second one, and where they part
let time = 0, going = true, rest = 0, before = 0, asked = 0;
let center = null; // where the world is while the camera does not follow

// The rows before and after an instant, by number, and how far it is between them, 0..1.
function between(rows, at) {
  let low = 0, high = rows.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (rows[middle][0] <= at) low = middle; else high = middle;
  }
  const begin = rows[low][0], span = rows[high][0] - begin;
  return [low, high, span > 0 ? Math.min(1, Math.max(0, (at - begin) / span)) : 1];
}

// A pose from rows t, x, y, z, qx, qy, qz, qw, put on an object.
function put(object, rows, at) {
  const [low, high, part] = between(rows, at), a = rows[low], b = rows[high];
  const side = a[4] * b[4] + a[5] * b[5] + a[6] * b[6] + a[7] * b[7] < 0 ? -1 : 1;
  const mix = (index, sign) => (1 - part) * a[index] + part * sign * b[index];
  object.position.set(mix(1, 1), mix(2, 1), mix(3, 1));
  object.quaternion.set(mix(4, side), mix(5, side), mix(6, side), mix(7, side)).normalize();
}

// A robot, and its wheels, which turn as its way makes them roll.
function drive(name, run, at) {
  put(node(name), run.robot, at);
  const [low, high, part] = between(run.robot, at);
  for (const { key, axis: [x, y, z], side } of run.wheels) {
    const angle = (1 - part) * run.turned[low][side] + part * run.turned[high][side];
    node(name, key).quaternion.setFromAxisAngle({ x, y, z }, angle);
  }
}

const end = (run) => (run ? run.robot[run.robot.length - 1][0] : 0);
const length = () => Math.max(end(play), end(ghost));

function draw() {
  if (play) {
    drive("robot", play, time);
    for (const [key, rows] of Object.entries(play.moving)) put(node("models", ...key.split("/")), rows, time);
    if (ghost) drive("ghost", ghost, time);
    place("time").value = time;
    const words = `${time.toFixed(1)} s of ${length().toFixed(1)} s`;
    if (place("clock").value !== words) {
      place("clock").value = words;
      place("time").setAttribute("aria-valuetext", words);
    }
  }
  if (place("follow").checked) {
    center ||= home().clone();
    const robot = node("robot").position;
    home().set(-robot.x, -robot.y, -robot.z);
  } else if (center) {
    home().copy(center);
    center = null;
  }
  viewer.set_dirty();
}

// While something moves, a smooth motion is worth more than a fine picture; what stands still is drawn in full.
let level = 0, looks = 0, spent = 0;

function refine(to) {
  looks = spent = 0;
  if (to === level) return;
  level = to;
  viewer.scene_tree.find(["Lights", "Sun"]).object.traverse((one) => one.isLight && (one.castShadow = level === 0));
  viewer.renderer.setPixelRatio(devicePixelRatio * SHARE[level]);
  viewer.set_dirty();
}

function look(seconds) {
  spent += seconds;
  if (++looks < LOOKS && spent < LATEST) return;
  refine(spent / looks > SLOW * 1.05 ? Math.min(level + 1, SHARE.length - 1) : level);
}

function frame(now) {
  requestAnimationFrame(frame);
  const passed = Math.min(0.25, (now - before) / 1000);
  if (play && going) look((now - before) / 1000);
  else refine(0);
  before = now;
  if (play && going) {
    if (time < length()) time = Math.min(length(), time + passed * place("speed").value);
    else if ((rest += passed) >= PAUSE) time = rest = 0;
  }
  if ((play && going) || place("follow").checked || center) draw();
  write();
}

// Edges around a model go where it goes; returns where a point of it has gone.
function follow(model, edges, point) {
  if (!edges.position.equals(model.position) || !edges.quaternion.equals(model.quaternion)) {
    edges.position.copy(model.position);
    edges.quaternion.copy(model.quaternion);
    viewer.set_dirty();
  }
  return point.applyQuaternion(model.quaternion).add(model.position);
}

// The letters of partitions stand over the models, wherever the camera is and the models go.
function write() {
  const letters = place("letters"), shown = place("parts").checked ? said.parts || [] : [];
  while (letters.childElementCount > shown.length) letters.lastChild.remove();
  shown.forEach(([letter, color, x, y, z, key], number) => {
    const span = letters.children[number] || letters.appendChild(document.createElement("span"));
    const at = home().clone().set(x, y, z);
    if (key) follow(node("models", key), node("parts", key), at);
    at.z += 0.1;
    viewer.scene_tree.find(["world"]).object.localToWorld(at);
    at.project(viewer.camera);
    if (span.textContent !== letter) span.textContent = letter;
    span.style.background = color;
    span.style.visibility = at.z < 1 ? "visible" : "hidden";
    span.style.transform = `translate(${((at.x + 1) / 2) * innerWidth}px, ${((1 - at.y) / 2) * innerHeight}px) translate(-50%, -100%)`;
  });
}

function go(to) {
  time = Math.min(length(), Math.max(0, to));
  rest = 0;
  draw();
}

function run(on) {
  going = on;
  if (on && time >= length()) time = rest = 0;
  place("toggle").textContent = on ? "Pause" : "Play";
}

async function ask(what) {
  const answer = await fetch(what);
  if (!answer.ok) throw new Error(answer.status === 404 ? await answer.text() : `the scene answers ${answer.status}`);
  return answer;
}

// Messages of Meshcat's protocol, each after its length in 4 bytes.
function obey(messages) {
  const view = new DataView(messages);
  for (let at = 0; at < messages.byteLength; ) {
    const size = view.getUint32(at);
    viewer.handle_command_bytearray(new Uint8Array(messages.slice(at + 4, at + 4 + size)));
    at += 4 + size;
  }
}

// Models that a test moved go back to where they start.
function reset() {
  for (const key of Object.keys(play ? play.moving : {})) {
    const model = node("models", ...key.split("/"));
    model.position.set(0, 0, 0);
    model.quaternion.set(0, 0, 0, 1);
  }
}

// Shows one finished test, or two of them together.
async function load(number, other = null) {
  const turn = ++asked;
  try {
    const wanted = [[`play/${number}`, "json"], [`way/${number}`, "arrayBuffer"]];
    // What the run shows is there already.
    const nothing = new ArrayBuffer(0), own = chosen;
    if (own) wanted.push([`still/${number}`, "arrayBuffer"]);
    if (other) wanted.push([`play/${other.ghost}`, "json"], [`ghost-way/${other.ghost}`, "arrayBuffer"]);
    const [first, drawn, ...more] = await Promise.all(wanted.map(async ([what, kind]) => (await ask(what))[kind]()));
    const still = own ? more.shift() : nothing, [second = null, ghostly = nothing] = more;
    if (turn !== asked) return;
    reset();
    [play, ghost, pair] = [first, second, other];
    if (own) {
      for (const key of play.gone) node("models", key).visible = false;
      for (const key of play.there) node("models", key).visible = true;
    }
    for (const gone of ["trail", "ghost-trail"]) viewer.scene_tree.find(["world"]).delete([gone]);
    for (const messages of [still, drawn, ghostly]) obey(messages);
    place("time").max = length();
    mark();
    caption();
    time = rest = 0;
    place("trouble").textContent = [play.lacks, second ? second.lacks : ""].join(" ").trim();
    draw();
  } catch (error) {
    if (turn === asked) place("trouble").textContent = error.message;
  }
}

// Where the two runs part: on the time slider, and in the world.
function mark() {
  const at = pair && (pair.apart ?? pair.equal);
  const button = place("parting"), option = document.createElement("option");
  button.hidden = place("marks").hidden = pair === null;
  node("ghost").visible = ghost !== null;
  node("parting").visible = pair !== null;
  place("marks").replaceChildren();
  if (pair === null) return;
  option.value = at;
  place("marks").append(option);
  button.textContent = `paths diverge at ${at.toFixed(1)} s`;
  put(node("parting"), ghost.robot, at);
  node("parting").quaternion.set(0, 0, 0, 1);
}

function caption() {
  const words = { ...said };
  if (play) words.time = "";
  if (play && chosen) {
    words.title = ghost ? `${play.title}, with a ghost: ${ghost.title}` : play.title;
    words.models = said.models.replace(/^\d+/, play.models);
  }
  document.title = `${words.name} · ddenv`;
  for (const name of ["name", "title", "models", "time"]) {
    const text = document.querySelector(`#caption .${name}`);
    if (text.textContent !== words[name]) text.textContent = words[name];
  }
}

function heed(words) {
  const old = said;
  said = words;
  const replay = words.kind === "replay";
  if (!chosen) {
    place("play").hidden = !replay;
    if (!replay) {
      asked++;
      reset();
      play = ghost = pair = null;
      mark();
    }
    if (replay && (old.kind !== "replay" || old.test !== words.test || old.models !== words.models)) load(words.test), offer();
  }
  if (words.test) place("test").placeholder = words.test;
  caption();
}

// The pairs that show why the robot fails.
async function offer() {
  const found = await (await ask("pairs")).json(), which = place("which");
  place("test").max = found.tests;
  while (which.options.length > 1) which.remove(1);
  for (const [number, one] of found.pairs.entries()) {
    const option = new Option(one.title, number);
    option.pair = one;
    which.add(option);
  }
}

viewer.connect(new URL("feed", location.href).href.replace("http", "ws"));
const take = viewer.connection.onmessage;
viewer.connection.onmessage = (message) => {
  if (typeof message.data === "string") heed(JSON.parse(message.data));
  // Who has chosen a test sees that one, whatever the run does.
  else if (!chosen) take(message);
};
viewer.connection.onclose = () => {
  place("lost").style.display = "block";
  setInterval(() => isBack().then((back) => back && location.reload(), () => {}), 2000);
};

// Whether our scene is back: whoever took its port meanwhile must not hear the token, see address.py.
async function isBack() {
  const bytes = (text) => new TextEncoder().encode(text), token = location.pathname.split("/")[1];
  const hex = (buffer) => [...new Uint8Array(buffer)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  const challenge = hex(crypto.getRandomValues(new Uint8Array(16)));
  const answer = await fetch(`/alive/${hex(await crypto.subtle.digest("SHA-256", bytes(token)))}/${challenge}`);
  const key = await crypto.subtle.importKey("raw", bytes(token), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const proof = hex(await crypto.subtle.sign("HMAC", key, bytes(`${challenge} ${said.port}`)));
  return answer.ok && (await answer.text()) === proof;
}

place("play").addEventListener("submit", (event) => event.preventDefault());
place("toggle").addEventListener("click", () => run(!going));
place("back").addEventListener("click", () => (run(false), go(time - STEP)));
place("on").addEventListener("click", () => (run(false), go(time + STEP)));
place("time").addEventListener("input", () => (run(false), go(Number(place("time").value))));
place("parting").addEventListener("click", () => (run(false), go(pair.apart ?? pair.equal)));
place("follow").addEventListener("change", draw);
place("removed").addEventListener("change", () => ((node("removed").visible = place("removed").checked), viewer.set_dirty()));
place("parts").addEventListener("change", () => ((node("parts").visible = place("parts").checked), viewer.set_dirty()));
place("which").addEventListener("change", () => {
  const one = place("which").selectedOptions[0].pair;
  // A page that is loaded anew has missed nothing of the run.
  if (!one) return location.reload();
  chosen = true;
  place("test").value = "";
  load(one.test, one);
});
place("test").addEventListener("change", () => {
  if (!place("test").value) return;
  chosen = true;
  load(Number(place("test").value));
});
const keys = {
  " ": () => run(!going), ",": () => place("back").click(), ".": () => place("on").click(),
  ArrowLeft: () => go(time - 1), ArrowRight: () => go(time + 1), Home: () => go(0), End: () => go(length()),
  g: () => pair && place("parting").click(), f: () => place("follow").click(), r: () => place("removed").click(),
  p: () => place("parts").click(),
};
document.addEventListener("keydown", (event) => {
  const typing = /^(INPUT|SELECT|BUTTON)$/.test(event.target.tagName);
  if (!typing && !event.ctrlKey && !event.altKey && !event.metaKey && keys[event.key]) {
    event.preventDefault();
    keys[event.key]();
  }
});
requestAnimationFrame(frame);
