// The page around the scene. Each module shows a part of what the server says, and sends what a visitor asks for.
import * as acts from "./acts.js";
import * as away from "./away.js";
import * as charts from "./charts.js";
import * as cockpit from "./cockpit.js";
import * as drawer from "./drawer.js";
import * as forms from "./forms.js";
import * as head from "./head.js";
import * as last from "./last.js";
import * as link from "./link.js";
import * as notes from "./notes.js";
import * as parts from "./parts.js";
import * as runs from "./runs.js";
import * as scene from "./scene.js";
import * as tabs from "./tabs.js";
import * as timeline from "./timeline.js";
import * as tower from "./tower.js";

const NARROW = "(max-width: 56rem)"; // in which the parts stand one below the other

for (const part of [notes, head, last, tower, timeline, tabs, charts, forms, runs, cockpit, acts, away, parts, scene])
  part.begin();
drawer.open(!matchMedia(NARROW).matches);
link.connect();
