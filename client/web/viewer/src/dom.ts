/** Elements of the page. */
type Child = Node | string | null | undefined | false;
type Props = Record<string, unknown>;

/** An element with properties (onclick, class, title, …) and children. */
export function element<K extends keyof HTMLElementTagNameMap>(tag: K, props: Props = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (key === "class") made.className = String(value);
    else if (key === "style") made.style.cssText = String(value);
    else if (key.startsWith("aria-") || key.startsWith("data-")) made.setAttribute(key, String(value));
    else Object.assign(made, { [key]: value });
  }
  made.append(...children.filter((child): child is Node | string => child !== null && child !== undefined && child !== false));
  return made;
}

export function byId(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return found;
}

export function button(text: string, onclick: () => void, props: Props = {}): HTMLButtonElement {
  return element("button", { type: "button", onclick, ...props }, text);
}

/** Buttons of which one is pressed. */
export function choice<T extends string>(options: [T, string][], chosen: T, choose: (value: T) => void): HTMLElement {
  const group = element("div", { class: "group", role: "group" });
  const show = (value: T) => {
    for (const [i, [option]] of options.entries()) group.children[i]!.setAttribute("aria-pressed", String(option === value));
  };
  for (const [value, text] of options) {
    group.append(
      button(text, () => {
        show(value);
        choose(value);
      }),
    );
  }
  show(chosen);
  return group;
}

export function select(options: [string, string][], chosen: string, choose: (value: string) => void, props: Props = {}): HTMLSelectElement {
  const made = element("select", { ...props, onchange: () => choose(made.value) });
  for (const [value, text] of options) made.append(element("option", { value, selected: value === chosen }, text));
  return made;
}

/** Says something for some seconds. */
export function toast(text: string, kind: "" | "bad" = ""): void {
  const line = element("p", { class: kind }, text);
  byId("toasts").append(line);
  setTimeout(() => line.remove(), kind === "bad" ? 7000 : 2500);
}

/** Opens the dialog with a title and content, which may close it. */
export function dialog(title: string, content: (close: () => void) => Child[]): void {
  const made = byId("dialog") as HTMLDialogElement;
  made.replaceChildren(element("h3", {}, title), ...content(() => made.close()).filter((child): child is Node => child instanceof Node));
  if (!made.open) made.showModal();
}

export function download(name: string, type: string, content: BlobPart): void {
  const url = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

export async function copy(text: string, what: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    toast(`Copied ${what}`);
  } catch {
    // Pages without the permission show it instead.
    dialog(what, (close) => [element("pre", {}, text), element("div", { class: "row" }, button("Close", close))]);
  }
}
