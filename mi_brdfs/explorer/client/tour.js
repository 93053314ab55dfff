// Guided tours: a text for each step, whose state is merged into the page's.
import { byId, element, subscripted } from "./util.js";
import { change, clean, goTo, session } from "./session.js";

export function startTours() {
  byId("tours").onclick = () => {
    byId("tour-list").replaceChildren(
      ...session.hello.tours.map(({ name, title, steps }) =>
        element(
          "li",
          {},
          element(
            "button",
            { class: "found", onclick: () => begin(name) },
            element("b", {}, title),
            element("span", {}, `${steps.length} steps`),
          ),
        ),
      ),
    );
    byId("tour-dialog").showModal();
  };
  byId("tour-next").onclick = () => go(session.state.tour.name, session.state.tour.step + 1);
  byId("tour-back").onclick = () => go(session.state.tour.name, session.state.tour.step - 1);
  byId("tour-leave").onclick = () => change({ tour: null }, true);
}

function begin(name) {
  byId("tour-dialog").close();
  go(name, 0);
}

/** Go to a step: the patches of all steps up to it are applied, so that each may be entered from anywhere. */
function go(name, step) {
  const tour = session.hello.tours.find((each) => each.name === name);
  if (step >= tour.steps.length) return change({ tour: null }, true);
  const patch = Object.assign({}, ...tour.steps.slice(0, step + 1).map(({ state }) => state));
  if (patch.subjects) patch.subjects = clean(patch).subjects;
  goTo({ ...patch, tour: { name, step } }, true);
  byId("tour").scrollIntoView({ block: "nearest" });
  byId("tour-title").focus();
}

export function drawTour() {
  const { tour } = session.state;
  const found = tour && session.hello?.tours.find(({ name }) => name === tour.name);
  const step = found?.steps[tour.step];
  byId("tour").hidden = !step;
  if (!step) return;
  byId("tour-name").textContent = `${found.title} · ${tour.step + 1} of ${found.steps.length}`;
  byId("tour-title").replaceChildren(...subscripted(step.title));
  byId("tour-text").replaceChildren(...step.text.split(/\n\s*\n/).map((text) => element("p", {}, ...subscripted(text))));
  byId("tour-back").disabled = tour.step === 0;
  byId("tour-next").textContent = tour.step + 1 === found.steps.length ? "Finish" : "Next";
}
