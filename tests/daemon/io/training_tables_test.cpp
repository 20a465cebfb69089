// The tables that training reads: what stands in them comes through, and what is wrong in them gets a sentence with its file and line.
#include <gtest/gtest.h>

#include <string>

#include "daemon/io/ansur.hpp"
#include "daemon/io/mocap_folder.hpp"
#include "fit/body/skeleton.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

class TrainingTables : public testing::Test {
 protected:
  /// train/q.npy with that many frames of zeros.
  void put_frames(int frames) {
    std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + std::to_string(frames) + ", " + std::to_string(fit::kDofs) + "), }\n";
    const auto length = static_cast<char>(header.size());
    folder_.write("train/q.npy", std::string("\x93NUMPY\x01\x00", 8) + length + std::string(1, '\0') + header +
                                     std::string(sizeof(float) * static_cast<std::size_t>(frames * fit::kDofs), '\0'));
  }

  template <typename Read>
  static std::string complaint(Read read) {
    try {
      read();
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "no complaint";
  }
  std::string folder_complaint() {
    return complaint([&] { return load_motion_folder(folder_.path, folder_.path / "held_out.csv"); });
  }

  tests::TemporaryFolder folder_;
};

const std::string kColumns = "clip,cmu_trial,subject,cls,start,frames,description\n";
const std::string kMeasures =
    "subjectid,age,stature,weightkg,chestcircumference,waistcircumference,buttockcircumference,thighcircumference,calfcircumference,trochanterionheight,"
    "acromionradialelength,radialestylionlength\n";
const std::string kPerson = "10027,41,1776,815,1074,933,1030,605,380,900,337,273";

TEST_F(TrainingTables, ClipsAndWhatIsSetAside) {
  put_frames(9);
  folder_.write("held_out.csv", "# why\n\nkind,id,use,note\nsubject,01,held_out,a walker\nclass,hang,excluded,\ntrial,01_02,excluded,later lines win\n");
  folder_.write("train/clips.csv", kColumns + "a,01_01,01,walk,0,4,to, and fro\r\nb,01_02,01,walk,4,2,\nc,02_01,02,hang,6,2,\nd,03_01,03,run,8,1,\n");
  const MotionFolder motions = load_motion_folder(folder_.path, folder_.path / "held_out.csv");
  EXPECT_EQ(motions.q.cols(), 9);
  ASSERT_EQ(motions.clips.size(), 4u);
  EXPECT_EQ(motions.clips[0].motion_class, "walk");
  EXPECT_EQ(motions.clips[1].start, 4);
  EXPECT_EQ(motions.clips[1].frames, 2);
  EXPECT_EQ(motions.clips[0].use, MotionUse::held_out);
  EXPECT_EQ(motions.clips[1].use, MotionUse::excluded);
  EXPECT_EQ(motions.clips[2].use, MotionUse::excluded);
  EXPECT_EQ(motions.clips[3].use, MotionUse::training);
}

TEST_F(TrainingTables, WithoutTheListOfWhatIsSetAsideNothingIsTrained) {
  put_frames(1);
  folder_.write("train/clips.csv", kColumns + "a,01_01,01,walk,0,1,\n");
  EXPECT_NE(folder_complaint().find("held_out.csv: No such file or directory; it lists the motions set aside"), std::string::npos) << folder_complaint();
  // A folder in its place can be opened, and read as nothing: that is not an empty list.
  std::filesystem::create_directory(folder_.path / "held_out.csv");
  EXPECT_NE(folder_complaint().find("it is a folder; it lists the motions set aside"), std::string::npos) << folder_complaint();
}

TEST_F(TrainingTables, WrongClipsAreNamedByTheirLine) {
  put_frames(4);
  folder_.write("held_out.csv", "subject,01,held_out,\n");
  const std::pair<std::string, std::string> wrong[] = {
      {"", "clips.csv: expected the columns"},
      {"clip,cmu_trial,subject,class,start,frames\n", "clips.csv:1: expected the columns"},
      {kColumns + "a,01_01,01,walk,0\n", "clips.csv:2: ends early"},
      {kColumns + "a,01_01,01,walk,0,2,\n\nb,01_01,01,walk,two,1,\n", "clips.csv:4: 'two' is not a whole number"},
      {kColumns + "a,01_01,01,walk,3,2,\n", "clips.csv:2: names frames that q.npy does not have"},
      {kColumns + "a,01_01,01,walk,-1,2,\n", "clips.csv:2: names frames that q.npy does not have"},
      {kColumns + "a,01_01,01,walk,2147483647,2147483647,\n", "clips.csv:2: names frames that q.npy does not have"},
  };
  for (const auto& [table, sentence] : wrong) {
    folder_.write("train/clips.csv", table);
    EXPECT_NE(folder_complaint().find(sentence), std::string::npos) << table << " -> " << folder_complaint();
  }
  folder_.write("train/clips.csv", kColumns + "a,01_01,01,walk,0,1,\n");
  folder_.write("held_out.csv", "subject,01,hold_out,\n");
  EXPECT_NE(folder_complaint().find("held_out.csv:1: expected 'subject|trial|class,ID,held_out|excluded,note'"), std::string::npos) << folder_complaint();
  folder_.write("held_out.csv", "subject,01,held_out,\n");
  folder_.write("train/q.npy", "no array");
  EXPECT_NE(folder_complaint().find("q.npy"), std::string::npos) << folder_complaint();
}

TEST_F(TrainingTables, PeoplesMeasures) {
  const auto table = folder_.write("men.csv", kMeasures + kPerson + "\n");
  const auto people = load_ansur(table, fit::Sex::men);
  ASSERT_EQ(people.size(), 1u);
  EXPECT_EQ(people[0].subject, 10027);
  EXPECT_DOUBLE_EQ(people[0].stature, 1.776);
  EXPECT_DOUBLE_EQ(people[0].mass, 81.5);
  EXPECT_DOUBLE_EQ(people[0].arm, 0.61);

  const std::pair<std::string, std::string> wrong[] = {
      {"", "men.csv: holds no columns"},
      {kMeasures, "men.csv:1: holds no person"},
      {"subjectid,age\n1,30\n", "there is no column 'stature'"},
      {kMeasures + kPerson.substr(0, kPerson.rfind(',')) + "\n", "men.csv:2: ends before column 'radialestylionlength'"},
      {kMeasures + "10027,41,17760" + kPerson.substr(13) + "\n", "men.csv:2: column 'stature' holds '17760', which is no such measure"},
      {kMeasures + "10027,41,nan" + kPerson.substr(13) + "\n", "men.csv:2: column 'stature' holds 'nan', which is no such measure"},
      {kMeasures + "10027,41," + kPerson.substr(13) + "\n", "men.csv:2: column 'stature' holds '', which is no such measure"},
  };
  for (const auto& [text, sentence] : wrong) {
    folder_.write("men.csv", text);
    const std::string said = complaint([&] { return load_ansur(table, fit::Sex::men); });
    EXPECT_NE(said.find(sentence), std::string::npos) << text << " -> " << said;
  }
}

TEST_F(TrainingTables, BodiesSetAside) {
  const auto list = folder_.write("bodies.csv", "# rule\nsex,subjectid\nmen,7\nwomen,8\nmen,9\n");
  EXPECT_EQ(load_held_out_bodies(list, fit::Sex::men), (std::vector<int>{7, 9}));
  EXPECT_EQ(load_held_out_bodies(list, fit::Sex::women), (std::vector<int>{8}));
  for (const auto& [line, sentence] : {std::pair<std::string, std::string>{"man,7\n", "expected 'men,ID' or 'women,ID'"},
                                       {"men,7,8\n", "expected 'men,ID' or 'women,ID'"},
                                       {"men,7x\n", "'7x' is not a whole number"},
                                       {"men,99999999999\n", "'99999999999' is not a whole number"}}) {
    folder_.write("bodies.csv", "men,1\n" + line);
    const std::string said = complaint([&] { return load_held_out_bodies(list, fit::Sex::men); });
    EXPECT_NE(said.find("bodies.csv:2: " + sentence), std::string::npos) << said;
  }
}

}  // namespace
}  // namespace booth::daemon
