// One fitted frame as plain values: what goes to DDS, to the session's files and to the live view.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

namespace booth::daemon {

inline constexpr int kRecordDofs = 36, kRecordJoints = 24, kRecordShape = 64;

enum class PersonState : std::uint8_t { lost, estimated, tracked };
enum class RecordSex : std::uint8_t { men, women };
enum class Stage : std::uint8_t { wait, cloud, fit, publish };
inline constexpr int kStages = 4;
inline constexpr std::array<const char*, kStages> kStageNames{"wait", "cloud", "fit", "publish"};

/// Joints and rotations in the booth frame (x forward, y left, z up), metres; q in the CMU frame (metres, radians). Trivially copyable: a session's log
/// is an array of these.
struct FrameRecord {
  std::uint64_t sequence = 0;        ///< number of the group since the session began
  std::int64_t captured_ns = 0;      ///< reference instant of the group, CLOCK_MONOTONIC
  std::int64_t captured_utc_ns = 0;  ///< the same instant, UTC
  std::int64_t published_ns = 0;     ///< when it had been handed to DDS, CLOCK_MONOTONIC
  std::array<std::int64_t, kStages> stage_ns{};
  std::uint64_t groups_dropped = 0;  ///< since the session began
  std::array<double, kRecordDofs> q{};
  std::array<double, kRecordShape> beta{};
  std::array<std::array<double, 3>, kRecordJoints> joints{};
  std::array<std::array<float, 4>, kRecordJoints> rotation{};    ///< x y z w, of the bone that ends in the joint
  std::array<std::array<float, 6>, kRecordJoints> covariance{};  ///< xx xy xz yy yz zz, m^2
  std::array<std::uint8_t, kRecordJoints> seen{};                ///< 0: inferred from the rest of the body
  float residual = 0;                                            ///< mean distance of the person's points to the fitted surface, metres
  float model_to_cloud = 0;                                      ///< mean distance of visible vertices to the points, metres
  float coverage = 0;                                            ///< fraction of the surface that points explain
  std::uint32_t points = 0;                                      ///< in the person's cloud
  PersonState person = PersonState::lost;
  RecordSex sex = RecordSex::men;
  std::uint8_t shape_count = 0;  ///< entries of beta
  std::uint8_t body_accepted = 0;
  std::uint8_t cameras = 0;        ///< in the group
  std::uint8_t others = 0;         ///< further persons on the stage, masked
  std::uint8_t session_state = 0;  ///< SessionState
  std::uint8_t reserved = 0;
};
static_assert(std::is_trivially_copyable_v<FrameRecord>);

}  // namespace booth::daemon
