// The inputs: texts with sliders, pickers, and a sentence at each field that is wrong.

import {by, el, say, shown} from "./dom.js"

const STEPS = 1000
const NARROW = window.matchMedia("(max-width: 860px)")

export class Form {
  constructor(setup, changed, wantPreset) {
    this.fields = new Map(setup.fields.map((field) => [field.name, field]))
    this.inputs = new Map()
    this.sliders = new Map()
    this.groups = new Map()
    this.changed = changed
    this.most = setup.most_models
    this.node = by("inputs")
    this.node.addEventListener("submit", (event) => event.preventDefault())
    this.node.replaceChildren(
      this.kinds(), this.group("numbers", "The seven numbers", this.rows("numbers")),
      this.group("suspension", "The suspension", [
        this.presets(setup.presets, setup.usual_preset, wantPreset), this.units(), ...this.rows("suspension"),
        el("details", {}, el("summary", {}, "Gas, drag and packing"), ...this.rows("more")),
      ]),
      this.models(setup.models, setup.usual_models), this.closures(setup.closures),
      this.group("case", "The case", this.rows("case"), true),
    )
    this.note("", null)
    this.show()
  }

  // What is rarely changed is folded where room is scarce.
  group(name, title, children, folded = false) {
    const inner = folded
      ? [el("details", {open: !NARROW.matches}, el("summary", {}, title), ...children)] : children
    const legend = el("legend", {class: folded ? "aside" : ""}, title)
    const node = el("fieldset", {id: `group-${name}`}, legend, ...inner)
    this.groups.set(name, node)
    return node
  }

  kinds() {
    const choice = (value, label, checked) => el(
      "label", {class: "pick"},
      el("input", {type: "radio", name: "kind", value, checked, onchange: () => {
        this.show()
        this.changed(true)
      }}), label)
    return el(
      "fieldset", {class: "kinds"}, el("legend", {}, "Describe the case by"),
      choice("suspension", "a powder in gas", true), choice("numbers", "seven numbers", false),
      el("p", {class: "error", id: "error-form", hidden: true}),
    )
  }

  rows(group) {
    return [...this.fields.values()].filter((field) => field.group === group)
      .map((field) => this.row(field))
  }

  row(field) {
    const id = `field-${field.name}`
    const told = [field.hint ? `${id}-hint` : "", `${id}-error`].join(" ").trim()
    const common = {id, name: field.name, "aria-describedby": told}
    let input
    if (field.options.length) {
      input = el("select", {...common, onchange: () => this.changed(true)},
        ...field.options.map((name) => el("option", {value: name}, name)))
    } else {
      input = el("input", {...common, type: "text", spellcheck: "false", maxlength: "400",
        oninput: () => {
          if (input.value.trim() === "inf") this.place(field.name, Infinity)
          this.changed(false)
        }})
    }
    input.value = field.start
    this.inputs.set(field.name, input)
    return el(
      "div", {class: "field"},
      el("label", {for: id}, field.label), input, this.slider(field, id),
      field.hint ? el("p", {class: "hint", id: `${id}-hint`}, field.hint) : null,
      el("p", {class: "error", id: `${id}-error`, hidden: true}),
    )
  }

  slider(field, id) {
    if (field.low === null) return null
    const slider = el("input", {
      type: "range", id: `${id}-slider`, min: 0, max: STEPS, step: 1,
      "aria-label": `${field.label}, slider`,
      oninput: () => {
        this.set(field.name, this.value(field, Number(slider.value) / STEPS))
        this.changed(false)
      },
    })
    this.sliders.set(field.name, slider)
    this.place(field.name, field.start === "inf" ? Infinity : Number.parseFloat(field.start))
    return slider
  }

  value(field, part) {
    const {low, high} = field
    return field.logarithmic ? low * (high / low) ** part : low + (high - low) * part
  }

  part(field, value) {
    const {low, high} = field
    const part = field.logarithmic ? Math.log(value / low) / Math.log(high / low)
      : (value - low) / (high - low)
    return Math.min(Math.max(part, 0), 1)
  }

  // Write a value in the unit of its field.
  set(name, value) {
    const field = this.fields.get(name)
    this.inputs.get(name).value = `${shown(value, 3)} ${field.unit}`.trim()
    this.place(name, value)
  }

  // Move the slider to a value; one that is infinite stands at the end.
  place(name, value) {
    const slider = this.sliders.get(name)
    if (!slider || Number.isNaN(value)) return
    slider.value = Math.round(STEPS * this.part(this.fields.get(name), value))
    slider.setAttribute("aria-valuetext", this.inputs.get(name)?.value ?? shown(value))
  }

  fill(texts) {
    for (const [name, text] of Object.entries(texts)) this.inputs.get(name).value = text
  }

  presets(names, usual, wantPreset) {
    this.preset = el("select", {id: "preset", onchange: () => wantPreset(this.preset.value)},
      ...names.map((name) => el("option", {value: name, selected: name === usual}, name)))
    return el("div", {class: "field"}, el("label", {for: "preset"}, "Preset"), this.preset)
  }

  units() {
    this.unit = el("select", {id: "units", onchange: () => this.changed(true)},
      el("option", {value: "si"}, "SI"), el("option", {value: "scaled"}, "scaled"))
    return el("div", {class: "field"}, el("label", {for: "units"}, "Show results in"), this.unit)
  }

  models(words, usual) {
    this.boxes = Object.entries(words).map(([name, told]) => {
      const box = el("input", {type: "checkbox", name: "model", value: name,
        checked: usual.includes(name), "aria-describedby": "error-models",
        onchange: () => this.changed(true)})
      return [box, el("label", {class: "pick"}, box, el("span", {}, el("b", {}, name), el("br"),
        el("span", {class: "hint"}, told.replace(/^the [\w -]+? model: /, ""))))]
    })
    const node = this.group("models", `Models to draw (up to ${this.most})`,
      [...this.boxes.map(([, label]) => label),
        el("p", {class: "error", id: "error-models", hidden: true})], true)
    this.boxes = this.boxes.map(([box]) => box)
    return node
  }

  closures(words) {
    this.closure = el("select", {id: "closures", "aria-describedby": "closures-hint error-closures",
      onchange: () => {
        say(by("closures-hint"), words[this.closure.value])
        this.changed(true)
      }}, ...Object.keys(words).map((name) => el("option", {value: name}, name)))
    return this.group("closures", "Closures", [el("div", {class: "field"},
      el("label", {for: "closures"}, "Closure set"), this.closure,
      el("p", {class: "hint", id: "closures-hint"}, Object.values(words)[0]),
      el("p", {class: "error", id: "error-closures", hidden: true}))], true)
  }

  get kind() {
    return this.node.querySelector("input[name=kind]:checked").value
  }

  show() {
    for (const kind of ["numbers", "suspension"]) this.groups.get(kind).hidden = kind !== this.kind
  }

  values() {
    return {
      kind: this.kind, preset: this.preset.value, closures: this.closure.value,
      units: this.kind === "suspension" ? this.unit.value : "scaled",
      models: this.boxes.filter((box) => box.checked).map((box) => box.value),
      fields: Object.fromEntries([...this.inputs].map(([name, input]) => [name, input.value])),
    }
  }

  // Mark one field, or take its mark away.
  note(name, sentence) {
    const input = this.inputs.get(name)
    const node = input ? by(`field-${name}-error`) : by(`error-${name || "form"}`) ?? by("error-form")
    if (!node) return
    say(node, sentence ?? "")
    node.hidden = !sentence
    if (!input) return
    if (sentence) input.setAttribute("aria-invalid", "true")
    else input.removeAttribute("aria-invalid")
  }

  mark(errors) {
    const names = [...this.inputs.keys(), "models", "closures", ""]
    for (const name of names) this.note(name, errors[name] ?? null)
  }

  follow(positions) {
    for (const [name, value] of Object.entries(positions)) {
      if (this.sliders.get(name) !== document.activeElement) this.place(name, value)
    }
  }
}
