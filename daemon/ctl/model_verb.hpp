// `boothctl model`: training the shape models and the pose prior, and saying what is in a file.
#pragma once

#include <filesystem>
#include <iosfwd>

namespace CLI {
class App;
}

namespace booth::daemon {

struct TrainShapeOptions {
  std::filesystem::path data;  ///< the command line's one folder for both of the next; run_model_train_shape() looks at those alone
  std::filesystem::path makehuman, ansur, out;
  std::filesystem::path held_out;  ///< held_out_bodies.csv; empty: the one in `out`
  int men = 1517, women = 1531;    ///< bodies in each database
  unsigned long seed = 1;
  int threads = 2;
};

struct TrainPoseOptions {
  std::filesystem::path motions, out;
  std::filesystem::path held_out;  ///< held_out_motions.csv; empty: the one beside `out`
  unsigned long seed = 1;
};

struct ModelInfoOptions {
  std::filesystem::path file;
  bool json = false;
};

/// Each writes its result to `out` (progress goes to standard error) and returns an exit status. Errors are std::runtime_error or
/// std::invalid_argument with a sentence for the person.
int run_model_train_shape(const TrainShapeOptions& options, std::ostream& out);
int run_model_train_pose(const TrainPoseOptions& options, std::ostream& out);
int run_model_info(const ModelInfoOptions& options, std::ostream& out);

/// Registers `model train-shape | train-pose | info` on boothctl's command line; parsing runs the one that is given, which throws what the
/// functions above throw.
void add_model_verbs(CLI::App& app);

}  // namespace booth::daemon
