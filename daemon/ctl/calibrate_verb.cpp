// boothctl calibrate: the board to print, cameras from views of it, and whether they still stand where they stood.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/calibrate/board_pdf.hpp"
#include "daemon/calibrate/calibration_store.hpp"
#include "daemon/calibrate/live_capture.hpp"
#include "daemon/calibrate/view_collector.hpp"
#include "daemon/calibrate/view_folder.hpp"
#include "daemon/config/load.hpp"
#include "daemon/ctl/calibrate_through.hpp"
#include "daemon/ctl/from_person.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/seed_option.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/drivers_factory.gpio.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/picture.hpp"
#include "daemon/io/png_image.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using fit::calibrate::Calibration;
using fit::calibrate::Errors;

struct Options {
  std::string print, paper = "a1", from, out, simulate, pictures, by, config;
  std::vector<std::string> assignments;
  double square_mm = 0;
  int views = 24;
  std::uint64_t seed = 1;
  bool verify = false, restore = false, confirm = false, json = false, live_simulation = false;
  std::string keep, socket;
  std::string from_person;
  bool dry_run = false;
};

const fit::calibrate::Paper& paper_of(const Options& o) {
  if (const auto* paper = fit::calibrate::find_paper(o.paper)) return *paper;
  throw VerbFailure(fmt::format("--paper {}: allowed are a4, a3, a2, a1 and a0", o.paper), 64);
}

fit::calibrate::Board board_of(const Options& o) {
  if (o.square_mm != 0 && !(o.square_mm >= 10 && o.square_mm <= 500)) throw VerbFailure("--square: millimetres from 10 to 500", 64);
  return {(o.square_mm != 0 ? o.square_mm : paper_of(o).square) / 1000};
}

fs::path file_of(const Options& o) {
  if (!o.out.empty()) return o.out;
  const Config config = load_config({.file = o.config, .assignments = o.assignments});
  if (config.cameras.kinect2.calibration.empty())
    throw VerbFailure("nobody says where the calibration belongs: name a file with --out, or set cameras.kinect2.calibration in the configuration");
  return config.cameras.kinect2.calibration;
}

std::string now_utc() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

std::string who(const Options& o) {
  if (!o.by.empty()) return o.by;
  for (const char* name : {"SUDO_USER", "USER", "LOGNAME"})
    if (const char* value = std::getenv(name); value != nullptr && *value != 0) return value;
  return "unknown";
}

void print_board(const Options& o) {
  const auto& paper = paper_of(o);
  write_file_atomically(o.print, board_pdf(paper));
  if (o.json)
    return print_json(
        {{"ok", true}, {"file", o.print}, {"paper", o.paper}, {"width_mm", paper.width}, {"height_mm", paper.height}, {"square_mm", paper.square}});
  std::cout << fmt::format("{}: board for {} ({} x {} mm), squares {} mm. Print at 100 % on matt paper with toner, check the ruler, and glue it flat.\n",
                           o.print, o.paper, paper.width, paper.height, paper.square);
}

void simulate(const Options& o) {
  SimulatedViews settings;
  settings.square = board_of(o).square, settings.views = o.views, settings.seed = o.seed;
  const auto look = simulated_views(settings);
  ViewFolder folder = create_view_folder(o.simulate, simulated_cameras(o.seed).planned);
  for (int v = 0; v <= o.views; ++v) write_view(folder, look(v));
  std::string truth = "# Where the simulated cameras really hang.\nversion = 1\n";
  for (const auto& c : simulated_cameras(o.seed).real) truth += camera_table(c);
  write_file_atomically(fs::path(o.simulate) / "truth.toml", truth);
  if (o.json) return print_json({{"ok", true}, {"folder", o.simulate}, {"views", folder.views}, {"square_mm", 1000 * settings.square}});
  std::cout << fmt::format("{}: {} views of a board with squares of {} mm by four simulated cameras; boothctl calibrate --from {}\n", o.simulate, folder.views,
                           1000 * settings.square, o.simulate);
}

/// What each camera saw of a view, side by side, the corners that were found marked.
void draw_view(const Options& o, const ViewFolder& folder, int view, const std::vector<hal::DepthFrame>& frames, const ViewCollector& collector) {
  std::vector<Picture> pictures;
  for (const auto& frame : frames) {
    const int c = hal::to_int(frame.camera);
    const auto& camera = folder.cameras[static_cast<std::size_t>(c)];
    const int width = camera.intrinsics.width, height = camera.intrinsics.height;
    Picture picture(width, height);
    std::vector<std::uint16_t> sorted = frame.infrared;
    const auto bright = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() - 1 - sorted.size() / 200);
    std::nth_element(sorted.begin(), bright, sorted.end());
    const double scale = 230 / std::sqrt(std::max<double>(*bright, 1));
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto grey =
            static_cast<std::uint8_t>(std::min(255.0, scale * std::sqrt(static_cast<double>(frame.infrared[static_cast<std::size_t>(y * width + x)]))));
        picture.set(x, y, {grey, grey, grey});
      }
    std::size_t corners = 0;
    for (const auto& s : collector.input().sightings) {
      if (s.view != view || s.camera != c) continue;
      corners = s.corner.size();
      for (Eigen::Index i = 0; i < s.pixel.cols(); ++i) picture.disc(static_cast<float>(s.pixel(0, i)), static_cast<float>(s.pixel(1, i)), 2, {60, 230, 90});
    }
    picture.caption(fmt::format("{}: {}", camera.name, corners > 0 ? fmt::format("{} corners", corners) : "no board"), 1);
    pictures.push_back(std::move(picture));
  }
  if (!pictures.empty()) write_png(fs::path(o.pictures) / fmt::format("view-{:03}.png", view), Picture::beside(pictures));
}

std::vector<ViewPicture> pictures_of(const ViewFolder& folder, const std::vector<hal::DepthFrame>& frames) {
  std::vector<ViewPicture> out;
  for (const auto& f : frames) {
    const int c = hal::to_int(f.camera);
    const auto& k = folder.cameras[static_cast<std::size_t>(c)].intrinsics;
    out.push_back({c, {k.width, k.height, f.infrared}, {f.depth.empty() ? 0 : k.width, f.depth.empty() ? 0 : k.height, f.depth}});
  }
  return out;
}

/// Once the other views tell where the floor is: views that hardly a camera saw the board in may show it lying there.
void look_on_floor(const ViewFolder& folder, ViewCollector& collector, bool talk) {
  for (int v = 0; v < folder.views; ++v) {
    if (collector.seen_in(v) >= 2) continue;
    const auto frames = read_view(folder, v);
    FoundBoards found = collector.find_on_floor(pictures_of(folder, frames), {});
    if (found.boards.size() < 2) continue;
    if (talk) std::cerr << fmt::format("view {:3} of {}: the board lies on the floor, seen by {} cameras\n", v + 1, folder.views, found.boards.size());
    std::erase_if(found.boards, [&](const auto& b) { return collector.saw(v, b.sighting.camera); });
    collector.add_to_view(v, std::move(found));
  }
}

/// All views of a folder, with a line each on a terminal.
ViewCollector collect(const Options& o, std::vector<hal::CameraDescription> cameras, const ViewFolder& folder) {
  ViewCollector collector(std::move(cameras), board_of(o));
  if (!o.pictures.empty()) fs::create_directories(o.pictures);
  const bool talk = ::isatty(STDERR_FILENO) != 0 && !o.json;
  for (int v = 0; v < folder.views; ++v) {
    const auto frames = read_view(folder, v);
    const ViewReport report = collector.add(pictures_of(folder, frames));
    if (!o.pictures.empty()) draw_view(o, folder, v, frames, collector);
    if (!talk) continue;
    std::string seen;
    for (const int c : report.seen) seen += (seen.empty() ? "" : ", ") + folder.cameras[static_cast<std::size_t>(c)].name;
    std::cerr << fmt::format("view {:3} of {}: {}\n", v + 1, folder.views,
                             !seen.empty()         ? "seen by " + seen
                             : report.mirrored > 0 ? "a mirrored board"
                             : report.foreign > 0  ? "another board"
                                                   : "no board");
  }
  look_on_floor(folder, collector, talk);
  return collector;
}

Json errors_json(const Errors& e, const std::vector<std::string>& names) {
  Json j{{"views", e.views},         {"pictures", e.pictures},           {"reprojection_px", e.reprojection_px},
         {"corner_mm", e.corner_mm}, {"corner_p95_mm", e.corner_p95_mm}, {"plane_mm", e.plane_mm}};
  j["cameras"] = Json::object();
  for (std::size_t c = 0; c < e.camera.size(); ++c)
    j["cameras"][names[c]] = {{"reprojection_px", e.camera[c].reprojection_px},
                              {"corner_mm", e.camera[c].corner_mm},
                              {"plane_mm", e.camera[c].plane_mm},
                              {"pictures", e.camera[c].pictures}};
  return j;
}

void say(const Options& o, const fs::path& file, const Calibration& c, const ViewCollector& collector) {
  const auto& names = collector.input().names;
  if (o.json) {
    Json j{{"accepted", c.accepted()},
           {"refusal", to_string(c.refusal)},
           {"sentence", c.sentence},
           {"file", c.accepted() ? file.string() : ""},
           {"views", collector.input().views},
           {"pictures_left_out", c.left_out},
           {"square_ratio", c.square_ratio},
           {"floor_rms_mm", c.floor_rms_mm},
           {"origin", c.origin_from_board ? "board" : "layout"},
           {"held_out", errors_json(c.errors, names)},
           {"remarks", c.remarks}};
    j["cameras"] = Json::array();
    for (std::size_t i = 0; i < c.cameras.size(); ++i) {
      const auto& camera = c.cameras[i];
      const auto& p = camera.booth_from_camera.translation;
      j["cameras"].push_back({{"name", names[i]},
                              {"serial", collector.cameras()[i].serial},
                              {"pictures", camera.pictures},
                              {"position", {p.x(), p.y(), p.z()}},
                              {"position_sd_mm", camera.position_sd_mm},
                              {"angle_sd_deg", camera.angle_sd_deg},
                              {"depth_gain", camera.depth.gain},
                              {"depth_offset", camera.depth.offset}});
    }
    std::cout << j.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  } else if (c.accepted()) {
    std::cout << fmt::format(
        "measured on views that the fit had not seen: corners {:.2f} px, {:.1f} mm between cameras (95 %: {:.1f}), depth {:.1f} mm off the board\n",
        c.errors.reprojection_px, c.errors.corner_mm, c.errors.corner_p95_mm, c.errors.plane_mm);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto& camera = c.cameras[i];
      const auto& p = camera.booth_from_camera.translation;
      std::cout << fmt::format("  {:<12} at ({:6.3f}, {:6.3f}, {:6.3f}) m, {} pictures, +-{:.1f} mm, +-{:.2f} degrees, depth {:+.1f} mm at 2 m\n", names[i],
                               p.x(), p.y(), p.z(), camera.pictures, camera.position_sd_mm, camera.angle_sd_deg, 1000 * (camera.depth.read(2) - 2));
    }
    std::cout << fmt::format("  floor: +-{:.1f} mm; origin by {}\n", c.floor_rms_mm,
                             c.origin_from_board ? "the board on the floor" : "the places that were planned");
    for (const auto& remark : c.remarks) std::cout << "  " << remark << "\n";
    std::cout << file.string() << "\n";
  }
  std::cout.flush();
}

/// Judges, stores or refuses, and says so.
void conclude(const Options& o, const fs::path& file, const ViewCollector& collector) {
  Calibration c = fit::calibrate::calibrate(collector.input());
  if (c.accepted())
    store_calibration(file, {.cameras = collector.cameras(),
                             .result = c,
                             .utc = now_utc(),
                             .by = who(o),
                             .software = "boothd " BOOTHD_VERSION,
                             .square = collector.input().board.square,
                             .views = collector.input().views});
  say(o, file, c, collector);
  if (c.accepted()) return;
  std::error_code ignored;
  throw VerbFailure(fmt::format("refused: {}{}", c.sentence, fs::exists(file, ignored) ? fmt::format(" ({} stays as it was)", file.string()) : ""));
}

void calibrate_from(const Options& o) {
  const fs::path file = file_of(o);
  const ViewFolder folder = open_view_folder(o.from);
  conclude(o, file, collect(o, folder.cameras, folder));
}

std::atomic<bool> interrupted{false};

void tell_panel(hal::Panel& panel, CaptureCue cue) {
  panel.show({.pattern = light_of(cue)});
  if (const auto sound = sound_of(cue)) panel.play(*sound);
}

void calibrate_live(const Options& o) {
  const fs::path file = file_of(o);
  const Config config = load_config({.file = o.config, .assignments = o.assignments});
  DepthSource source;
  std::function<void()> move_on;
  if (o.live_simulation) {
    SimulatedCalibration simulated = open_simulated_calibration({.square = board_of(o).square, .views = o.views, .seed = o.seed}, 3);
    source.clock = simulated.clock;
    source.cameras = std::move(simulated.cameras);
    move_on = std::move(simulated.move_on);
  } else {
    source = open_source(config);
  }
  const PanelDevice panel = open_panel(config, *source.clock);
  std::optional<ViewFolder> keep;
  LiveCaptureSettings settings;
  settings.board = board_of(o);
  LiveCaptureHooks hooks;
  constexpr int kPatience = 4;
  int waited = 0;
  std::string said;
  hooks.news = [&](const CaptureNews& news) {
    if (panel.panel) tell_panel(*panel.panel, news.cue);
    // The simulated person moves on after a view, and when a place turns out to be no good; a look or two may still show where he was.
    waited = news.cue == CaptureCue::hold_still ? 0 : waited + 1;
    if (move_on && (news.cue == CaptureCue::captured || waited >= kPatience)) move_on(), waited = 0;
    std::string seen;
    for (const auto& name : news.seen) seen += (seen.empty() ? "" : ", ") + name;
    const std::string line =
        fmt::format("{} views; {}{}{}", news.taken, to_string(news.cue), seen.empty() ? "" : " (" + seen + ")", news.next.empty() ? "" : "; " + news.next);
    if (line != said) std::cerr << line << "\n";
    said = line;
  };
  if (!o.keep.empty()) {
    std::vector<hal::CameraDescription> cameras;
    for (const auto& c : source.cameras) cameras.push_back(c->description());
    keep = create_view_folder(o.keep, cameras);
    // Pictures are kept for convenience: a full disk must not cost the views that a person has shown already.
    hooks.view = [&keep](int, const std::vector<hal::DepthFrame>& frames) {
      if (!keep) return;
      try {
        write_view(*keep, frames);
      } catch (const std::exception& e) {
        std::cerr << "warning: pictures are not kept any more: " << e.what() << "\n";
        keep.reset();
      }
    };
  }
  std::signal(SIGINT, [](int) { interrupted = true; });
  hooks.stop = [] { return interrupted.load(); };
  conclude(o, file, capture_live(source.cameras, *source.clock, settings, hooks));
}

/// The stored cameras in the order of the folder's, told by their names.
std::vector<fit::calibrate::CalibratedCamera> matched(const StoredCalibration& stored, const ViewFolder& folder, const fs::path& file) {
  std::vector<fit::calibrate::CalibratedCamera> out;
  for (const auto& camera : folder.cameras) {
    std::size_t i = 0;
    while (i < stored.cameras.size() && stored.cameras[i].name != camera.name) ++i;
    if (i == stored.cameras.size())
      throw VerbFailure(fmt::format("{}: has no camera '{}', of which {} holds pictures", file.string(), camera.name, folder.path.string()));
    if (stored.cameras[i].serial != camera.serial)
      throw VerbFailure(fmt::format("{}: {} was the sensor {} when it was calibrated, now it is {}: calibrate again", file.string(), camera.name,
                                    stored.cameras[i].serial, camera.serial));
    out.push_back(stored.calibrated[i]);
  }
  return out;
}

void verify_from(Options o) {
  const fs::path file = file_of(o);
  const StoredCalibration stored = load_calibration(file);
  if (o.square_mm == 0 && stored.square) o.square_mm = 1000 * *stored.square;
  const ViewFolder folder = open_view_folder(o.from);
  const auto cameras = matched(stored, folder, file);
  const ViewCollector collector = collect(o, folder.cameras, folder);
  const auto verdict = fit::calibrate::verify(collector.input(), cameras);
  if (o.json) {
    const Json j{{"good", verdict.good}, {"sentence", verdict.sentence}, {"errors", errors_json(verdict.errors, collector.input().names)}};
    std::cout << j.dump(2, ' ', false, Json::error_handler_t::replace) << "\n" << std::flush;
  }
  if (!verdict.good) throw VerbFailure(verdict.sentence);
  if (!o.json) std::cout << verdict.sentence << "\n";
}

void restore(const Options& o) {
  const fs::path file = file_of(o), before = restore_calibration(file);
  if (o.json) return print_json({{"ok", true}, {"file", file.string()}, {"restored", before.string()}});
  std::cout << fmt::format("{}: now what {} was\n", file.string(), before.filename().string());
}

void confirm(const Options& o) {
  const fs::path file = file_of(o);
  confirm_calibration(file);
  if (o.json) return print_json({{"ok", true}, {"file", file.string()}});
  std::cout << file.string() << ": has the checksum of what stands in it\n";
}

void from_person(const Options& o) {
  Config config = load_config({.file = o.config, .assignments = o.assignments});
  const bool named = !o.out.empty() || !config.cameras.kinect2.calibration.empty();
  const fs::path file = named ? file_of(o) : fs::path();
  calibrate_from_person(
      {.recording = o.from_person, .file = file, .config = std::move(config), .utc = now_utc(), .by = who(o), .dry_run = o.dry_run, .json = o.json});
}

void run(const Options& o) {
  const int tasks = !o.print.empty() + !o.from.empty() + !o.simulate.empty() + !o.from_person.empty() + o.restore + o.confirm;
  if (tasks > 1) throw VerbFailure("--print, --from, --from-person, --simulate, --restore and --confirm exclude each other", 64);
  if (o.dry_run && o.from_person.empty()) throw VerbFailure("--dry-run belongs to --from-person", 64);
  if (o.verify && o.from.empty()) throw VerbFailure("--verify needs the views to look at: --from DIR", 64);
  const bool own = o.live_simulation || !o.keep.empty() || !o.out.empty();
  if (tasks == 0 && (own || !calibrate_through_boothd(o.socket, o.json))) calibrate_live(o);
  if (o.restore) restore(o);
  if (o.confirm) confirm(o);
  if (!o.print.empty()) print_board(o);
  if (!o.simulate.empty()) simulate(o);
  if (!o.from_person.empty()) from_person(o);
  if (!o.from.empty()) o.verify ? verify_from(o) : calibrate_from(o);
}

}  // namespace

void add_calibrate_verb(CLI::App& app) {
  auto o = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand(
      "calibrate", "Find where the cameras stand from views of a printed board, measure how wrong that is, and refuse what is not good enough");
  verb->add_option("--print", o->print, "Write the board as PDF, at true scale with a ruler");
  verb->add_option("--paper", o->paper, "a4, a3, a2, a1 or a0: the board's size, to print and to calibrate with")->capture_default_str();
  verb->add_option("--square", o->square_mm, "What a square measures in millimetres, where the print came out differently");
  verb->add_option("--from", o->from, "Folder of captured views (docs/reference/files.md)");
  verb->add_option("--from-person", o->from_person, "Recording of somebody who moves before the cameras: refine the calibration by it where that is better");
  verb->add_flag("--dry-run", o->dry_run, "With --from-person: say what would be changed, and change nothing");
  verb->add_option("--out", o->out, "Calibration file to write or to verify; without it the configuration's cameras.kinect2.calibration");
  verb->add_flag("--verify", o->verify, "Only look whether the cameras still stand as the calibration says; one view is enough");
  verb->add_flag("--confirm", o->confirm, "Give a file that was edited its checksum, once it is as it should be");
  verb->add_flag("--restore", o->restore, "Put the calibration before in the file's place, where the present one is damaged or wrong");
  verb->add_option("--by", o->by, "Who calibrates, for the record; without it the user's name");
  verb->add_option("--pictures", o->pictures, "Folder for a picture of each view, with the corners that were found");
  verb->add_option("--keep", o->keep, "New folder for the views that are captured live, to calibrate from again");
  verb->add_flag("--live-simulation", o->live_simulation, "Capture from simulated cameras and a simulated person who shows the board");
  verb->add_option("--simulate", o->simulate, "Write a folder of simulated views, with the truth beside them");
  verb->add_option("--views", o->views, "How many to simulate")->check(CLI::Range(1, 900))->capture_default_str();
  as_seed(verb->add_option("--seed", o->seed, "Of the simulation"));
  verb->add_option("--config", o->config, "Configuration file; without it /etc/boothd/boothd.toml where it exists");
  verb->add_option("--set", o->assignments, "key=value, over the file's; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_option("--socket", o->socket, "Control socket of a running boothd, which then calibrates itself");
  verb->add_flag("--json", o->json, "One JSON object");
  verb->callback([o] { run(*o); });
}

}  // namespace booth::daemon
