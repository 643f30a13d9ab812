/** What nobody needs before the first picture: read when the page is there. */
import { mountCorrecting } from "./check/edits.js";
import { one, parts } from "./elements/dom.js";
import { mountTips } from "./elements/tips.js";
import { mountBookmarks, mountIdentity, mountTables } from "./inspector/tables.js";
import { mountReading } from "./timeline/reading.js";

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountLater(context, timeline) {
	const side = one(".side");
	mountTips();
	mountTables(side, context);
	mountIdentity(context);
	mountBookmarks(parts(side).marks, context);
	mountReading(context, timeline);
	mountCorrecting(context, timeline);
	timeline.draw();
}
