// Recording and calibration are matched by the cameras' names and places: a refinement is a step from where the recording was made.
#include "daemon/ctl/from_person.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>

#include "daemon/calibrate/person_refinement.hpp"
#include "daemon/calibrate/refined_calibration.hpp"
#include "daemon/calibrate/view_collector.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.calibration.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Cameras of the recording, which must stand in it where the file has them.
void check_places(const std::vector<hal::CameraDescription>& recorded, const FromPerson& task) {
  constexpr double kSame = 0.001, kSameTurn = 0.001;  // m, rad: numbers that went through another format
  const auto stored = read_cameras(task.file);
  for (const auto& camera : recorded) {
    const auto it = std::find_if(stored.begin(), stored.end(), [&](const auto& s) { return s.name == camera.name; });
    if (it == stored.end())
      throw VerbFailure(fmt::format("{}: has no camera '{}', of which {} holds pictures", task.file.string(), camera.name, task.recording));
    const auto a = rigid_of(it->camera_to_world), b = rigid_of(camera.camera_to_world);
    if ((a.translation - b.translation).norm() > kSame || fit::calibrate::angle_between(a.rotation, b.rotation) > kSameTurn)
      throw VerbFailure(fmt::format("{} was made with another calibration than {} (camera {} stands elsewhere in it): record anew", task.recording,
                                    task.file.string(), camera.name));
  }
}

Json to_json(const PersonRefinement& r, const FromPerson& task, bool stored) {
  Json j{{"better", r.better},
         {"stored", stored},
         {"sentence", r.sentence},
         {"file", task.file.string()},
         {"recording", task.recording},
         {"seconds", r.seconds},
         {"passes", r.passes},
         {"held_out_frames", r.held_out_frames},
         {"residual_before_mm", 1e3 * r.residual_before},
         {"residual_after_mm", 1e3 * r.residual_after},
         {"gain_mm", 1e3 * r.gain},
         {"gain_deviation_mm", 1e3 * r.gain_deviation},
         {"disagreement_before_mm", 1e3 * r.disagreement_before},
         {"disagreement_after_mm", 1e3 * r.disagreement_after}};
  j["cameras"] = Json::array();
  for (std::size_t c = 0; c < r.cameras.size(); ++c)
    j["cameras"].push_back({{"name", r.cameras[c].name},
                            {"displacement_mm", 1e3 * r.change[c].displacement},
                            {"deviation_mm", 1e3 * r.change[c].deviation},
                            {"shift_mm", 1e3 * r.change[c].shift},
                            {"turn_deg", r.change[c].turn * 180 / M_PI},
                            {"late_ms", 1e3 * r.change[c].late},
                            {"late_deviation_ms", 1e3 * r.change[c].late_deviation}});
  return j;
}

}  // namespace

void calibrate_from_person(const FromPerson& task) {
  if (task.file.empty() && !task.dry_run) throw VerbFailure("nobody says which calibration is to be refined: name it with --out", 64);
  RefinementInput input;
  input.config = task.config;
  input.open = [&] { return open_recording_source(task.recording); };
  const DepthSource source = input.open();
  for (const auto& camera : source.cameras) input.cameras.push_back(camera->description());
  if (input.cameras.size() < 2) throw VerbFailure(fmt::format("{}: has one camera; there is nothing that it could disagree with", task.recording));
  if (!task.file.empty()) check_places(input.cameras, task);
  if (::isatty(STDERR_FILENO)) input.say = [](const std::string& line) { std::cerr << line << "\n"; };
  const PersonRefinement r = refine_from_person(input);
  const bool store = r.better && !task.dry_run;
  if (store)
    store_refined_calibration(
        task.file, r, {.utc = task.utc, .by = task.by, .software = "boothctl " BOOTHD_VERSION, .recording = fs::path(task.recording).filename().string()});
  if (task.json) {
    std::cout << to_json(r, task, store).dump(2, ' ', false, Json::error_handler_t::replace) << "\n" << std::flush;
  } else if (r.better) {
    std::cout << r.sentence << "\n";
    for (std::size_t c = 0; c < r.cameras.size(); ++c)
      std::cout << fmt::format("  {:<12} moves by {:5.1f} mm and {:5.2f} degrees at a person (+-{:.1f} mm), its time stamps by {:+.1f} ms (+-{:.1f})\n",
                               r.cameras[c].name, 1e3 * r.change[c].shift, r.change[c].turn * 180 / M_PI, 1e3 * r.change[c].deviation, -1e3 * r.change[c].late,
                               1e3 * r.change[c].late_deviation);
    if (store) std::cout << fmt::format("{}: refined; restart boothd to use it\n", task.file.string());
    if (!store) std::cout << "nothing was changed (--dry-run)\n";
  }
  if (!r.better) throw VerbFailure(fmt::format("refused: {}{}", r.sentence, task.file.empty() ? "" : fmt::format(" ({} stays as it was)", task.file.string())));
}

}  // namespace booth::daemon
