// What the bridge tells, as text and map; STOP, and letting the robot drive again.
// Whatever comes from a vehicle is put in as text, never as HTML.

import { Drawing } from "./map.js";

const LOST = 1500, RETRY = 400, UNCONFIRMED = 1500, HOLD = 1200, CONFIRM = 5000, ANSWER = 3000, LOOK = 100, VIEW = 500, LINE = 5000;  // [ms]
const VIEWS = 120;  // what was seen within the last minute
const ENDED = ["IDLE", "RELEASED", "YIELDED", "ESTOP"];
const id = (name) => document.getElementById(name);
const drawing = new Drawing(id("map"));
let state = {}, heard = 0, opened = performance.now(), source = null, dirty = false, silence = 0;

// ---- the token: behind the link's #, which no browser sends; kept for this tab, out of sight

const token = location.hash.slice(1) || sessionStorage.getItem("token") || "";
sessionStorage.setItem("token", token);
history.replaceState(null, "", location.pathname);

// ---- what comes in

async function open() {
  if (source || document.hidden) return;
  const mine = source = new AbortController();
  try {
    const answer = await fetch("events", { cache: "no-store", headers: { "X-Kmpc": token }, signal: mine.signal });
    if (!answer.ok) throw new Error((await answer.text()).trim());
    keepLine();  // not before: the stream would take it
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let text = "", part; !(part = await reader.read()).done; ) {
      const events = (text + part.value).split("\n\n");
      text = events.pop();
      for (const event of events) if (event.startsWith("data: ")) take(JSON.parse(event.slice(6)));
    }
  } catch (error) { if (!mine.signal.aborted) say("reason", String(error.message || error)); }
  if (source === mine) { source = null; setTimeout(open, 1000); }
}

function take(news) {
  heard = performance.now();
  if ("silence" in news) { silence = news.silence; return; }
  silence = 0;
  if ("trail" in news) state = { wish: state.wish };  // everything is told anew
  const trail = "trail" in news ? news.trail : state.trail || [];
  Object.assign(state, news);
  if (news.pose && !("trail" in news)) trail.push(news.pose[0], news.pose[1]);
  if (trail.length > 8000) trail.splice(0, 2000);
  state.trail = trail;
  if (news.seen) remember(news.seen);
  draw();
}

function remember(seen) {  // now and then one; the newest is drawn all the same
  const views = state.views || (state.views = []);
  if (performance.now() - (state.viewed || -Infinity) < VIEW) return;
  state.viewed = performance.now();
  views.push(seen);
  if (views.length > VIEWS) views.shift();
}

// a hidden tab watches nothing: a browser has few connections, and STOP needs one
document.addEventListener("visibilitychange", () => {
  if (document.hidden) { if (source) source.abort(); source = null; } else { opened = performance.now(); open(); }
});

// ---- what is shown

const SHOWN = { plan: "plan", path: "path", trail: "trail", margin: "margins", circle: "circles", scan: "scan", unseen: "seen", goal: "goal" };

const number = (value, digits, unit) =>
  typeof value === "number" ? `${value.toFixed(digits)} ${unit}` : "–";
const colour = (name, kind) => { if (id(name).className !== kind) id(name).className = kind; };
const say = (name, text) => { if (id(name).textContent !== text) id(name).textContent = text; };

function words() {
  const { step = {}, link = {}, command, pose } = state;
  say("title", state.title || "kmpc live");
  say("gate", state.over ? "over" : state.gate || "connecting");
  const wrong = state.over ? [] : state.wrong || [];
  const bad = !state.over && (state.latched || wrong.length > 0);
  colour("gate", bad ? "bad" : state.gate === "ACTIVE" && !state.over ? "good" : "");
  say("distance", number(state.distance, 2, "m"));
  say("clearance", state.clearance === null ? "no obstacle" : number(state.clearance, 2, "m"));
  say("speed", command ? number(command[0], 2, "m/s") : "–");
  say("turn", command ? number(command[1], 2, "rad/s") : "–");
  say("status", [state.status, state.progress].filter(Boolean).join(", ") || "–");
  say("step", step.p50 ? `${step.p50.toFixed(1)} ms, p99 ${step.p99.toFixed(1)} ms` : "–");
  say("pose", pose ? `${pose[0].toFixed(2)}, ${pose[1].toFixed(2)} m, ${(pose[2] * 180 / Math.PI).toFixed(0)}°` : "none yet");
  say("link", link.text || "–");
  say("time", number(state.time, 1, "s"));
  for (const [name, key] of Object.entries(SHOWN)) {
    document.querySelector(`#legend .${name}`).hidden = !(state[key] && state[key].length);
  }
  say("reason", state.over || state.reason || state.gate_text || "");
  const list = id("wrong");
  if (list.dataset.shown !== JSON.stringify(wrong)) {
    list.dataset.shown = JSON.stringify(wrong);
    list.replaceChildren(...wrong.map((text) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }));
  }
}

function lostFor(now) {
  if (document.hidden || state.over) return 0;
  const since = heard || opened;
  if (now - since > LOST) return (now - since) / 1000;
  return silence > 1 ? silence : 0;
}

// a picture is drawn when there is news, never in between: a finger does not wait for pictures
function draw() {
  if (!dirty) requestAnimationFrame(() => { dirty = false; words(); look(); drawing.draw(state); });
  dirty = true;
}

function look() {
  const now = performance.now();
  const lost = state.lost ? "" : lostFor(now);
  const gone = Boolean(lost) || Boolean(state.lost && !state.over);
  if (id("lost").hidden !== !gone) id("lost").hidden = !gone;
  document.body.classList.toggle("lost", gone);
  if (gone) {
    say("lost", (lost ? `NOT HEARD for ${Math.floor(lost)} s` : "THE BRIDGE HAS ENDED")
      + ": what you see is old, and STOP may not arrive. Use the switch on the robot.");
  }
  if (gone) words();
  if (gone) { say("gate", "not heard"); colour("gate", "bad"); }
  stopLook(now, gone);
  againLook(now);
  goalLook(now);
}

// ---- STOP: sent again until the bridge has confirmed it

let asked = 0, trying = false, confirmed = false, refused = "";

async function post(path, body, patience = ANSWER) {
  const answer = await fetch(path, {
    method: "POST", cache: "no-store", signal: AbortSignal.timeout(patience),
    headers: { "Content-Type": "application/json", "X-Kmpc": token }, body: JSON.stringify(body || {}),
  });
  const text = await answer.text();
  if (path !== "line" && path !== "stop") keepLine();  // that may have taken the line
  if (!answer.ok) throw new Error(text.trim());
  return JSON.parse(text);
}

// a connection that is in use now and then stays open: STOP takes it, whoever crowds the door
function keepLine() {
  if (!document.hidden && !trying) post("line").catch(() => {});  // the stream tells what is lost
}

async function stop() {
  if (trying) return;
  trying = true; confirmed = false; refused = ""; asked = performance.now();
  stopLook(asked, false);
  while (!confirmed) {
    try {
      const answer = await post("stop");
      confirmed = Boolean(answer.confirmed);
      if (!confirmed) refused = (answer.why || []).join("; ");
      look();
    } catch (error) { refused = String(error.message || error); }
    if (state.latched && state.gate === "ESTOP") confirmed = true;
    if (state.over) break;
    if (!confirmed) await new Promise((done) => setTimeout(done, RETRY));
  }
  trying = false;
}

function stopLook(now, gone) {
  const holds = state.latched && state.gate === "ESTOP" && !gone;
  if (!holds && !trying && confirmed && !gone && now - asked > 2000) { confirmed = false; asked = 0; }
  const late = trying && now - asked > UNCONFIRMED;
  const held = holds || (confirmed && !trying);
  colour("stop", held ? "held" : late ? "failed" : trying ? "asked" : "");
  say("word", held ? "STOPPED" : trying ? (late ? "NOT CONFIRMED" : "STOP …") : "STOP");
  say("holds", held ? "confirmed: it holds until it is allowed to drive"
    : late ? "use the switch on the robot; still trying" + (refused ? `: ${refused}` : "")
    : trying ? "asked for, not yet confirmed"
    : state.over ? "the drive is over" : "stops the robot and holds it");
}

id("stop").addEventListener("pointerdown", stop);  // a finger that comes down is enough
id("stopper").addEventListener("submit", (event) => { event.preventDefault(); stop(); });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") stop(); });

// ---- letting it drive again: hold, then confirm within 5 s

let holding = 0, code = "", until = 0;

function againLook(now) {
  const may = !state.over && ENDED.includes(state.gate);
  if (id("again").hidden !== !may) id("again").hidden = !may;
  if (!may) { code = ""; holding = 0; }
  if (code && now > until) { code = ""; say("told", "not confirmed in time: hold again"); }
  if (id("confirm").disabled !== !code) id("confirm").disabled = !code;
  say("confirm", code ? `Confirm within ${Math.ceil((until - now) / 1000)} s: it drives` : "then confirm");
  if (holding && now - holding >= HOLD) held();
}

function begin(event) {
  if (event.type === "keydown" && (event.repeat || ![" ", "Enter"].includes(event.key))) return;
  event.preventDefault();
  holding = performance.now();
  id("hold").classList.add("held");
}

function end() { holding = 0; id("hold").classList.remove("held"); }

async function held() {
  end();
  try {
    code = (await post("first")).code;
    until = performance.now() + CONFIRM;
    say("told", "");
  } catch (error) { say("told", String(error.message || error)); }
}

async function confirmIt() {
  const shown = code;
  code = "";
  if (!shown) return;
  try {
    const answer = await post("second", { code: shown }, 6000);
    say("told", answer.ok ? "" : "refused: " + ((answer.why || []).join("; ") || "no reason was told"));
    if (answer.ok) { confirmed = false; asked = 0; }
  } catch (error) { say("told", String(error.message || error)); }
}

// ---- a goal: tap the map, drag for its heading, then confirm within 5 s

let pressed = null, goalCode = "", goalUntil = 0;

function wishFor(event) {
  const here = drawing.place(event), robot = state.pose || [0, 0, 0];
  const moved = Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > 12;  // [px]
  const [x, y] = pressed.place, from = moved ? [x, y] : robot, to = moved ? here : [x, y];
  return [x, y, Math.atan2(to[1] - from[1], to[0] - from[0])];
}

id("map").addEventListener("pointerdown", (event) => {
  if (!state.clicks || state.over) return;
  pressed = { x: event.clientX, y: event.clientY, place: drawing.place(event) };
  id("map").setPointerCapture(event.pointerId);
});

id("map").addEventListener("pointermove", (event) => {
  if (pressed) { state.wish = wishFor(event); draw(); }
});

id("map").addEventListener("pointerup", async (event) => {
  if (!pressed) return;
  state.wish = wishFor(event);
  pressed = null;
  draw();
  try {
    goalCode = (await post("first", { goal: state.wish })).code;
    goalUntil = performance.now() + CONFIRM;
    say("wish", "");
  } catch (error) { state.wish = null; say("wish", String(error.message || error)); }
});

id("map").addEventListener("pointercancel", () => { pressed = state.wish = null; draw(); });

function goalLook(now) {
  const may = Boolean(state.clicks && !state.over);
  if (id("there").hidden !== !may) { id("there").hidden = !may; id("map").classList.toggle("clicks", may); }
  if (goalCode && now > goalUntil) { goalCode = ""; state.wish = null; say("wish", "not confirmed in time: tap again"); draw(); }
  if (id("go").disabled !== !goalCode) id("go").disabled = !goalCode;
  if (goalCode) {
    const [x, y, theta] = state.wish;
    say("wish", `to ${x.toFixed(2)}, ${y.toFixed(2)} m, ${(theta * 180 / Math.PI).toFixed(0)}°`);
    say("go", `Drive there (${Math.ceil((goalUntil - now) / 1000)} s)`);
  } else {
    say("go", "Drive there");
    if (!id("wish").textContent) say("wish", "tap the map: a goal; drag: its heading");
  }
}

async function driveThere() {
  const shown = goalCode;
  if (!shown) return;
  goalCode = "";
  try {
    const answer = await post("second", { code: shown });
    say("wish", answer.ok ? "" : "refused: " + (answer.why || []).join("; "));
  } catch (error) { say("wish", String(error.message || error)); }
  state.wish = null;
  draw();
}

for (const name of ["pointerup", "click"]) id("go").addEventListener(name, driveThere);  // no click ends a flick
for (const name of ["pointerdown", "keydown"]) id("hold").addEventListener(name, begin);
for (const name of ["pointerup", "pointerleave", "pointercancel", "keyup", "blur"]) {
  id("hold").addEventListener(name, end);
}
id("hold").addEventListener("contextmenu", (event) => event.preventDefault());
id("confirm").addEventListener("click", confirmIt);
window.addEventListener("resize", draw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
open();
draw();
setInterval(look, LOOK);
setInterval(keepLine, LINE);
