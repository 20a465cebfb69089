// Who is measured: the shipped models, and the bodies that no training has seen.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"

namespace booth::accuracy {

/// A set-aside body with the model whose topology and skin weights serve it.
struct Subject {
  int number = 0;  ///< as in test:N
  const daemon::TestBody* body = nullptr;
  std::shared_ptr<const fit::BodyModel> model;

  fit::Sex sex() const { return body->sex; }
  /// Its true bone vectors, for forward_kinematics().
  fit::Points3 bone_vectors() const { return model->bone_vectors_from_joints(body->rest_joints); }
  /// Its true surface and joints in pose q; CMU frame, metres.
  fit::Vertices surface(const fit::PoseVector& q) const;
  fit::Points3 joints(const fit::PoseVector& q) const;
};

/// Immutable and thread-safe after construction.
class Subjects {
 public:
  /// `folder` empty: where find_models() looks. Throws what the loaders throw.
  explicit Subjects(const std::filesystem::path& folder = {});

  Subject get(int number) const;  ///< 1 to count()
  int count() const { return static_cast<int>(bodies_.size()); }
  const daemon::FitModels& models() const { return models_; }
  /// The same with joints by eq. 3 as published, for preset `paper`.
  const daemon::FitModels& paper_models() const { return paper_models_; }
  const std::filesystem::path& folder() const { return folder_; }
  /// Versions of the models, as a page names them.
  std::string versions() const;
  /// Changes with the bytes of the models' files.
  std::string identity() const;

 private:
  std::filesystem::path folder_;
  daemon::FitModels models_, paper_models_;
  std::vector<daemon::TestBody> bodies_;
};

}  // namespace booth::accuracy
