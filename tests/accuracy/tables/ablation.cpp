// Tables ablation, figure2 and figure3: what is lost when one part of the fit is left out, or some of the cameras.
#include <fmt/format.h>

#include "daemon/io/fit_picture.hpp"
#include "tests/accuracy/booth/poses.hpp"
#include "tests/accuracy/booth/stills.hpp"
#include "tests/accuracy/methods/estimator_method.hpp"
#include "tests/accuracy/report/pictures.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

constexpr std::uint64_t kSeed = 4045;

struct Variant {
  const char* name;
  fit::FitParts parts{};
  unsigned cameras = kAllCameras;
  bool start_given = false;
};

struct Case {
  Subject subject;
  fit::PoseVector truth;
  Stills stills;
  int pose;
};

Case case_of(const Subjects& subjects, int body) {
  Case c{subjects.get(body), {}, {}, (body - 1) % 3 + 1};
  Random random(kSeed, static_cast<std::uint64_t>(body));
  c.truth = anywhere(c.subject, study_pose(c.subject, c.pose), 0.2, random);
  c.stills = render_stills(c.subject, {c.truth}, {}, kSeed + static_cast<std::uint64_t>(body));
  return c;
}

FittedBody fit_variant(const Subjects& subjects, const Case& c, const Variant& variant, fit::Preset preset) {
  Booth booth;
  const fit::Observation& observation = booth.look(c.stills, 0, variant.cameras);
  const auto estimator = make_estimator(subjects, preset, choice_of(c.subject.sex()), {.parts = variant.parts});
  const fit::PoseVector start = comparator_start(estimator->model(), observation.cloud, c.truth[4]);
  const bool paper = preset == fit::Preset::paper;
  const fit::FitResult* result = &estimator->fit(observation, paper || variant.start_given ? &start : nullptr);
  if (paper) {
    constexpr std::uint64_t kFrames = 10;
    fit::Observation frame = observation;
    for (frame.frame = 1; frame.frame < kFrames; ++frame.frame) {
      stop_if_requested();
      frame.time = static_cast<double>(frame.frame) / 30;
      result = &estimator->step(frame);
    }
  }
  return fitted_body(*estimator, *result);
}

/// Every variant on one body: one unit.
Samples try_all(const Subjects& subjects, int body, const std::vector<Variant>& variants, const std::vector<fit::Preset>& presets) {
  const Case c = case_of(subjects, body);
  Samples out;
  for (const Variant& variant : variants)
    for (const fit::Preset preset : presets) {
      stop_if_requested();
      const char* method = preset == fit::Preset::booth ? "booth" : "paper";
      const FittedBody fitted = fit_variant(subjects, c, variant, preset);
      add_errors(fitted, c.subject, c.truth, fmt::format("{}, pose {}", variant.name, c.pose), method, out);
    }
  return out;
}

std::vector<int> bodies_of(const Request& request) {
  std::vector<int> out;
  for (int body = 1; body <= 90; ++body)
    if ((body - 1) % 45 < (request.short_form ? 3 : 15) && !(request.short_form && body > 45)) out.push_back(body);
  return out;
}

constexpr const char* kCommon =
    "Bodies and poses of tables 1 and 2 (the first fifteen men and women, five of each in each pose), one frame of four cameras with Kinect v2 noise, sex "
    "known.";

Plan plan_of(const Request& request, const std::vector<Variant>& variants, const std::vector<fit::Preset>& presets) {
  Plan plan;
  for (const int body : bodies_of(request))
    plan.units.push_back(
        {fmt::format("test:{}", body), [subjects = request.subjects, body, variants, presets] { return try_all(*subjects, body, variants, presets); }});
  return plan;
}

/// The same body with and without, from two sides, coloured by its distance from the true surface.
Plan plan_of_figure(const Request& request, const Variant& without, const char* file) {
  const std::vector<Variant> variants{{"with"}, without};
  Plan plan = plan_of(request, variants, {fit::Preset::booth, fit::Preset::paper});
  plan.pictures = [subjects = request.subjects, variants, file](const Samples&, const std::filesystem::path& folder) {
    std::vector<std::string> names;
    for (const int body : {2, 3}) {
      const Case c = case_of(*subjects, body);
      std::vector<ErrorView> views;
      for (const Variant& v : variants)
        for (const auto& [preset, name] : {std::pair{fit::Preset::booth, "booth"}, {fit::Preset::paper, "paper"}})
          views.push_back({fmt::format("{}, {}", name, v.name), fit_variant(*subjects, c, v, preset).vertices});
      names.push_back(fmt::format("{}-pose-{}.png", file, c.pose));
      draw_errors(folder / names.back(), c.subject, c.truth, views);
    }
    return names;
  };
  return plan;
}

}  // namespace

Plan plan_ablation(const Request& request) {
  const std::vector<Variant> variants{{"everything"},
                                      {"without pose prior", {.pose_prior = false}},
                                      {"without shape prior", {.shape_prior = false}},
                                      {"one-sided energy", {.two_sided = false}},
                                      {"without symmetry", {.symmetry = false}},
                                      {"search only", {.refinement = false}},
                                      {"refinement only", {}, kAllCameras, true},
                                      {"one camera", {}, 0x1},
                                      {"two cameras", {}, 0x5},
                                      {"three cameras", {}, 0x7}};
  Plan plan = plan_of(request, variants, {fit::Preset::booth});
  plan.protocol = std::string(kCommon) +
                  " One part of preset `booth` is left out at a time. One-sided: the model's distance from the cloud alone, as published. Search only: the "
                  "best of the start's candidates, mean body, not "
                  "refined. Refinement only: no search; it starts from the A-pose with the true heading at the cloud's middle. One camera is the front-left "
                  "one, two are opposite each other.";
  return plan;
}

Plan plan_figure2(const Request& request) {
  Plan plan = plan_of_figure(request, {"without pose prior", {.pose_prior = false}}, "figure2");
  plan.protocol = std::string(kCommon) +
                  " The paper's figure 2: with and without the pose prior, in preset `booth` (its limits and its spread go too) and in preset `paper` (ten "
                  "swarms from the given start).";
  return plan;
}

Plan plan_figure3(const Request& request) {
  Plan plan = plan_of_figure(request, {"without shape prior", {.shape_prior = false}}, "figure3");
  plan.protocol = std::string(kCommon) +
                  " The paper's figure 3: with and without the shape prior, in preset `booth` and in preset `paper` (ten swarms from the given start).";
  return plan;
}

}  // namespace booth::accuracy
