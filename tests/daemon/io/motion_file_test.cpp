// Motions from files: the angles that CMU's skeleton shares with q come through exactly, the rest in the right places; broken files get a sentence.
#include "daemon/io/motion_file.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "daemon/io/cmu_fold.hpp"

namespace booth::daemon {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

class MotionFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    const auto path =
        std::filesystem::path(testing::TempDir()) / ("booth-motion-" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + "-" + name);
    std::ofstream(path, std::ios::binary) << text;
    files_.push_back(path);
    return path;
  }
  ~MotionFile() override {
    for (const auto& f : files_) std::filesystem::remove(f);
  }
  static std::string complaint(const std::filesystem::path& path) {
    try {
      read_motion(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }

 private:
  std::vector<std::filesystem::path> files_;
};

/// Four frames at 120 Hz make one of ours; `lines` is the body of each.
std::string amc(const std::vector<std::string>& frames) {
  std::string text = "#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n";
  for (std::size_t i = 0; i < frames.size(); ++i) text += std::to_string(i + 1) + "\n" + frames[i];
  return text;
}

const std::string kFrame =
    "root 10 15 -30 5 25 3\nlowerback 4 -3 2\nupperback 6 5 -1\nthorax 3 4 2\nlowerneck -10 3 2\nupperneck 12 2 -3\nhead 5 10 2\n"
    "rclavicle 0 0\nrhumerus -40 -5 -70\nrradius 30\nrwrist 4\nrhand 1 2\nlclavicle 0 0\nlhumerus -10 -15 80\nlradius 45\n"
    "rfemur -35 2 17\nrtibia 30\nrfoot -4 1\nrtoes -20\nlfemur 20 9 -22\nltibia 12\nlfoot -3 -5\nltoes 1\n";

TEST_F(MotionFile, AmcKeepsTheLegsAndTheRootsRotation) {
  const auto frames = read_motion(write("a.amc", amc({kFrame, kFrame, kFrame, kFrame, kFrame})));
  ASSERT_EQ(frames.size(), 2u);  // frames 1 and 5
  const auto& q = frames[0];
  EXPECT_NEAR(q[fit::dof_index("rfemur_rx")], -35 * kDegree, 1e-9);
  EXPECT_NEAR(q[fit::dof_index("lfemur_rz")], -22 * kDegree, 1e-9);
  EXPECT_NEAR(q[fit::dof_index("rtibia_rx")], 30 * kDegree, 1e-9);
  EXPECT_NEAR(q[fit::dof_index("lfoot_rz")], -5 * kDegree, 1e-9);
  EXPECT_NEAR(q[0], 10 * 0.0254 / 0.45, 1e-9);
  fit::Kinematics kin;
  fit::forward_kinematics(q, fit::average_bone_vectors(), kin);
  const Eigen::Matrix3d expected = (Eigen::AngleAxisd(3 * kDegree, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(25 * kDegree, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(5 * kDegree, Eigen::Vector3d::UnitX()))
                                       .matrix();
  EXPECT_LT((kin.rotation[0] - expected).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(MotionFile, TheFoldPutsHandsShouldersAndHeadWhereTheFullSkeletonHasThem) {
  // The full skeleton's chain by hand, for the left wrist: lowerback, upperback, thorax, clavicle, humerus, radius.
  const auto q = read_motion(write("b.amc", amc({kFrame})))[0];
  fit::Kinematics kin;
  fit::forward_kinematics(q, fit::average_bone_vectors(), kin);
  const auto turn = [](double rx, double ry, double rz) -> Eigen::Matrix3d {
    return (Eigen::AngleAxisd(rz * kDegree, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(ry * kDegree, Eigen::Vector3d::UnitY()) *
            Eigen::AngleAxisd(rx * kDegree, Eigen::Vector3d::UnitX()))
        .matrix();
  };
  Eigen::Matrix3d g = turn(5, 25, 3);
  Eigen::Vector3d p = q.head<3>();
  g = g * turn(4, -3, 2);
  p += g * Eigen::Vector3d(0, 0.115516, -0.008933);
  g = g * turn(6, 5, -1);
  p += g * Eigen::Vector3d(0, 0.115999, -0.000864);
  g = g * turn(3, 4, 2);
  p += g * Eigen::Vector3d(0, 0.117347, 0.003400);
  EXPECT_LT((kin.joint.col(fit::joint_index("chest_top")) - p).norm(), 0.02);
  p += g * Eigen::Vector3d(0.180284, 0.064964, -0.008808);
  EXPECT_LT((kin.joint.col(fit::joint_index("lshoulder")) - p).norm(), 0.006);
  const Eigen::Matrix3d c = turn(180, -30, -90);
  g = g * c * turn(-10, -15, 80) * c.transpose();
  p += g * Eigen::Vector3d(0.292819, -0.000004, -0.000007);
  g = g * c * turn(45, 0, 0) * c.transpose();
  p += g * Eigen::Vector3d(0.280160, 0, 0);
  EXPECT_LT((kin.joint.col(fit::joint_index("lwrist")) - p).norm(), 0.002);
}

/// The MotionBuilder-friendly layout with the joints that matter, two frames after the T-pose.
std::string bvh(const std::string& frame_time, const std::string& values) {
  std::string text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n";
  int open = 1;
  for (const char* name : {"LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot", "LowerBack", "Spine", "Spine1", "Neck", "Neck1", "Head",
                           "LeftShoulder", "LeftArm", "LeftForeArm", "RightShoulder", "RightArm", "RightForeArm"}) {
    text += "JOINT " + std::string(name) + "\n{\nOFFSET 1 2 3\nCHANNELS 3 Zrotation Yrotation Xrotation\n";
    ++open;
  }
  text += "End Site\n{\nOFFSET 0 0 1\n}\n";
  for (int i = 0; i < open; ++i) text += "}\n";
  return text + "MOTION\nFrames: 3\nFrame Time: " + frame_time + "\n" + values;
}

TEST_F(MotionFile, BvhGivesTheSameAsAmc) {
  std::string row = "10 15 -30 3 25 5";  // position, then z y x
  for (int i = 0; i < 18; ++i) row += i == 6 ? " 2 -3 4" : i == 7 ? " -1 5 6" : " 0 0 0";
  const auto from_bvh = read_motion(write("c.bvh", bvh("0.0333333", row + "\n" + row + "\n" + row + "\n")));
  ASSERT_EQ(from_bvh.size(), 2u) << "the T-pose in front is dropped";
  const auto from_amc = read_motion(write("c.amc", amc({"root 10 15 -30 5 25 3\nlowerback 4 -3 2\nupperback 6 5 -1\n"})));
  EXPECT_LT((from_bvh[0] - from_amc[0]).cwiseAbs().maxCoeff(), 1e-6);
}

TEST_F(MotionFile, AFileThatEndsInsideAFrameLosesThatFrame) {
  const std::string text = amc({kFrame, kFrame, kFrame, kFrame, kFrame});
  EXPECT_EQ(read_motion(write("d.amc", text.substr(0, text.size() - 60))).size(), 1u);
}

TEST_F(MotionFile, BrokenFilesGetASentenceWithTheLine) {
  EXPECT_NE(complaint(write("e.amc", "")).find("no complete frame"), std::string::npos);
  EXPECT_NE(complaint(write("f.amc", "lfemur 1 2 3\n")).find("line 1"), std::string::npos);
  EXPECT_NE(complaint(write("g.amc", amc({"root 1 2 nan 4 5 6\n"}))).find("line 5"), std::string::npos);
  EXPECT_NE(complaint(write("h.amc", amc({"root 1 2 3 4 5 6\nlfemur 1 2\n"}))).find("line 6"), std::string::npos);
  EXPECT_NE(complaint(write("i.amc", amc({"lfemur 1 2 3\n"}))).find("root"), std::string::npos);
  EXPECT_NE(complaint(write("j.bvh", "HIERARCHY\nROOT Hips\n{\nCHANNELS 99\n")).find("CHANNELS"), std::string::npos);
  EXPECT_NE(complaint(write("k.bvh", "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 2\nFrame Time: 0.01\n")).find("joints"), std::string::npos);
  EXPECT_NE(complaint(write("l.bvh", bvh("0.0333", "1 2 3\n"))).find("ends too early"), std::string::npos);
  EXPECT_NE(complaint(write("m.bvh", bvh("nan", ""))).find("finite"), std::string::npos);
  EXPECT_FALSE(complaint(write("n.npy", "\x93NUMPY")).empty());
  EXPECT_FALSE(complaint("nothing.amc").empty());
  EXPECT_TRUE(is_motion_file("a/b.npy"));
  EXPECT_FALSE(is_motion_file("walk"));
}

}  // namespace
}  // namespace booth::daemon
