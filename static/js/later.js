/** What nobody needs before the first picture: read when the page is there. */
import { mountCorrecting } from "./check/edits.js";
import { mountMagnifier } from "./cameras/magnify.js";
import { one, parts } from "./elements/dom.js";
import { mountBookmarks } from "./inspector/bookmarks.js";
import { mountIdentity } from "./inspector/identity.js";
import { mountTables } from "./inspector/tables.js";
import { mountTeach } from "./inspector/teach.js";
import { mountKeep } from "./sheets/keep.js";
import { mountSheets } from "./sheets/sheets.js";
import { drawBraid } from "./timeline/braid.js";
import { mountFingers } from "./timeline/fingers.js";
import { mountHint } from "./timeline/hint.js";
import { mountPlots } from "./timeline/plots.js";

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountLater(context, timeline) {
	const { store } = context;
	const [side, mosaic] = [one(".side"), one(".mosaic")];
	mountTables(side, context);
	mountIdentity(context);
	mountBookmarks(parts(side).marks, context);
	mountMagnifier(mosaic, store);
	mountTeach(mosaic, context);
	mountSheets(context);
	mountKeep(context);
	mountHint(timeline, store);
	mountFingers(timeline.plot, store);
	mountPlots(context, timeline);
	mountCorrecting(context, timeline);
	timeline.braid = drawBraid;
	timeline.draw();
}
