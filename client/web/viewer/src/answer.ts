/** The panel with the answer: the grasp, how long it took, and why it changed. */
import { type CurrentGraspReport, CurrentGraspStatus, type Grasp, type GraspOrigin, Outcome, type SearchReport } from "#contract/grasp_pb";
import { button, element } from "./dom";
import { vector } from "./poses";
import { checkName, digitName, handName, milliseconds, outcomeName, sourceName, statusName, typeName, valueOf } from "./words";

/** An answer of a search or of a track. */
export interface Answer {
  outcome: Outcome;
  grasp: Grasp | null;
  current?: CurrentGraspReport | undefined;
  report?: SearchReport | undefined;
  origin?: GraspOrigin | undefined;
  warnings: string[];
  serverMs: number;
  roundTripMs: number;
}

function outcomeOf({ outcome, current }: Answer): [string, string] {
  if (current) {
    const kinds: Partial<Record<CurrentGraspStatus, string>> = {
      [CurrentGraspStatus.KEPT]: "good",
      [CurrentGraspStatus.ADJUSTED]: "good",
      [CurrentGraspStatus.REPLANNED]: "fair",
    };
    return [statusName(current.status), kinds[current.status] ?? "bad"];
  }
  return [outcomeName(outcome), outcome === Outcome.FOUND ? "good" : "bad"];
}

/** Why the grasp was changed or there is none, in words. */
function reasons({ current, report, grasp }: Answer): string[] {
  const all: string[] = [];
  const failed = current?.failedCheck;
  if (failed) all.push(`The last grasp failed ${checkName(failed.check).toLowerCase()}: ${failed.description}`);
  if (current?.movedDigits.length) all.push(`Moved: ${current.movedDigits.map(digitName).join(", ").toLowerCase()}`);
  if (current && current.noGrasp !== 0 && !grasp) all.push(`No grasp because of ${checkName(current.noGrasp).toLowerCase()}`);
  if (!grasp) {
    for (const limit of report?.limits ?? []) all.push(limit.description);
    const miss = report?.nearestMiss?.verdict;
    if (miss) all.push(`Nearest miss: ${checkName(miss.check).toLowerCase()}. ${miss.description}`);
  }
  return all;
}

/** `again` searches anew. */
export function answerPanel(answer: Answer, again: () => void): HTMLElement[] {
  const { grasp, report, origin } = answer;
  const [outcome, kind] = outcomeOf(answer);
  const lines = reasons(answer);
  const head = element(
    "section",
    { id: "answer" },
    element("h2", {}, "Grasp", button("Search again", again, { class: "small", id: "again" }), element("span", { class: `pill ${kind}`, id: "outcome" }, outcome)),
    element(
      "div",
      { class: "headline" },
      element("strong", { id: "type" }, grasp ? typeName(grasp.type) : "–"),
      element("span", { class: "ms", id: "ms", title: "Time on the server" }, milliseconds(answer.serverMs)),
    ),
    element(
      "div",
      { class: "row dim" },
      grasp?.hand ? `${handName(grasp.hand.handedness)}, ${origin ? sourceName(origin.source).toLowerCase() : "tracked"}` : "",
      element("span", { class: "grow" }),
      `${milliseconds(answer.roundTripMs)} round trip`,
    ),
    ...(grasp?.score !== undefined
      ? [
          element(
            "div",
            { class: "row", style: "margin-top: 8px", title: grasp.scoreTerms.map((t) => `${t.name} ${t.value.toFixed(2)} (weight ${t.weight.toFixed(2)})`).join("\n") },
            element("span", { class: "dim" }, "Score"),
            element("span", { class: "bar" }, element("i", { style: `width: ${100 * grasp.score}%` })),
            element("b", { id: "score" }, grasp.score.toFixed(2)),
          ),
        ]
      : []),
    lines.length > 0 && element("ul", { class: "warnings", id: "why" }, ...lines.map((line) => element("li", {}, line))),
    answer.warnings.length > 0 && element("ul", { class: "warnings" }, ...answer.warnings.map((line) => element("li", {}, line))),
  );
  if (!grasp) return [head];
  const contacts = element(
    "section",
    {},
    element("h2", {}, "Contacts"),
    element(
      "table",
      { id: "contacts" },
      ...grasp.contacts.map((contact) =>
        element("tr", {}, element("td", {}, digitName(contact.digit)), element("td", {}, `${vector(contact.force).length().toFixed(2)} N`)),
      ),
    ),
  );
  const checks = element(
    "section",
    {},
    element("h2", {}, "Margins", element("span", { class: "dim" }, report ? `${report.attempts} attempts` : "")),
    element(
      "table",
      {},
      ...grasp.margins.map((margin) =>
        element("tr", { title: margin.description }, element("td", {}, checkName(margin.check)), element("td", {}, valueOf(margin))),
      ),
      ...(grasp.arm
        ? [element("tr", {}, element("td", {}, "Wrist bent"), element("td", {}, `${((grasp.arm.wristFlexion * 180) / Math.PI).toFixed(0)}°, ${((grasp.arm.wristDeviation * 180) / Math.PI).toFixed(0)}°`))]
        : []),
    ),
  );
  return [head, contacts, checks];
}
