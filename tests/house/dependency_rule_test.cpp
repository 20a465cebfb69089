// hal, fit, drivers and daemon include only whom they may; and the check that says so catches every kind of violation.
#include <gmock/gmock.h>

#include "tests/house/dependency_rule.hpp"

namespace booth::tests {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<std::string> kRooms{"hal", "fit", "drivers", "daemon"};

TEST(DependencyRule, HoldsInEveryRoom) {
  const Sources sources = read_sources(BOOTH_SOURCE_DIR, kRooms);
  for (const std::string& room : kRooms)
    EXPECT_TRUE(std::any_of(sources.begin(), sources.end(), [&](const auto& s) { return s.first.rfind(room + "/", 0) == 0; }))
        << "no sources found in " << room;
  std::string all;
  for (const std::string& v : dependency_violations(sources)) all += v + "\n";
  EXPECT_EQ(all, "");
}

TEST(DependencyRule, IncludesHaveNoCycle) {
  std::string all;
  for (const std::string& c : include_cycles(read_sources(BOOTH_SOURCE_DIR, kRooms))) all += c + "\n";
  EXPECT_EQ(all, "");
}

/// What the check says about one file among innocent ones.
std::vector<std::string> verdict(const std::string& path, const std::string& contents) {
  Sources sources{{"hal/a.hpp", ""},         {"fit/gpu/a.hpp", ""},           {"fit/a.hpp", "#include <Eigen/Core>\n"},
                  {"drivers/usb/a.hpp", ""}, {"drivers/synthetic/a.hpp", ""}, {"daemon/a.hpp", ""}};
  sources[path] = contents;
  return dependency_violations(sources);
}

TEST(DependencyRule, CatchesPlantedViolations) {
  EXPECT_THAT(verdict("hal/x.hpp", "#pragma once\n#include \"fit/a.hpp\"\n"), ElementsAre(HasSubstr("hal/x.hpp:2: hal/ may not include fit")));
  EXPECT_THAT(verdict("hal/x.hpp", "#include <Eigen/Core>\n"), ElementsAre(HasSubstr("may not include Eigen")));
  EXPECT_THAT(verdict("hal/x.hpp", "#include <unistd.h>\n"), ElementsAre(HasSubstr("may not include POSIX")));
  EXPECT_THAT(verdict("fit/gpu/x.hpp", "#include \"fit/a.hpp\"\n"), ElementsAre(HasSubstr("fit/gpu/ may not include fit")));
  EXPECT_THAT(verdict("drivers/usb/x.cpp", "#include \"fit/gpu/a.hpp\"\n"), ElementsAre(HasSubstr("drivers/ may not include fit")));
  EXPECT_THAT(verdict("drivers/kinect2/x.cpp", "#include \"fit/a.hpp\"\n"), ElementsAre(HasSubstr("drivers/kinect2/ may not include fit")));
  EXPECT_THAT(verdict("fit/x.cpp", "#include <cuda_runtime.h>\n"), ElementsAre(HasSubstr("may not include CUDA")));
  EXPECT_THAT(verdict("fit/x.cpp", "#include \"hal/a.hpp\"\n"), ElementsAre(HasSubstr("fit/ may not include hal")));
  EXPECT_THAT(verdict("fit/x.cpp", "  #  include \"daemon/a.hpp\"  // sly\n"), ElementsAre(HasSubstr("fit/ may not include daemon")));
  EXPECT_THAT(verdict("fit/x.cpp", "#include <fmt/format.h>\n"), ElementsAre(HasSubstr("may not include fmt")));
  EXPECT_THAT(verdict("drivers/usb/x.cpp", "#include \"fit/a.hpp\"\n"), ElementsAre(HasSubstr("drivers/ may not include fit")));
  EXPECT_THAT(verdict("drivers/recording/x.cpp", "#include \"fit/a.hpp\"\n"), ElementsAre(HasSubstr("drivers/recording/ may not include fit")));
  EXPECT_THAT(verdict("drivers/usb/x.cpp", "#include <png.h>\n"), ElementsAre(HasSubstr("may not include libpng")));
  EXPECT_THAT(verdict("daemon/x.cpp", "#include \"drivers/usb/a.hpp\"\n"), ElementsAre(HasSubstr("daemon/ may not include drivers")));
  EXPECT_THAT(verdict("daemon/x.cpp", "#include <gtest/gtest.h>\n"), ElementsAre(HasSubstr("may not include GoogleTest")));
  EXPECT_THAT(verdict("daemon/x.cpp", "#include \"a.hpp\"\n"), ElementsAre(HasSubstr("named from the root")));
  EXPECT_THAT(verdict("daemon/x.cpp", "#include <unheard/of.hpp>\n"), ElementsAre(HasSubstr("nobody has said")));
  EXPECT_THAT(verdict("cellar/x.cpp", ""), ElementsAre(HasSubstr("no rule")));
  EXPECT_THAT(verdict("fit/x.cpp", "/* a\n comment */ #include \"hal/a.hpp\"\n"), ElementsAre(HasSubstr("fit/x.cpp:2:")));
}

TEST(DependencyRule, AllowsWhatItShould) {
  EXPECT_THAT(verdict("hal/x.hpp", "#include <chrono>\n#include \"hal/a.hpp\"\n"), IsEmpty());
  EXPECT_THAT(verdict("drivers/synthetic/x.cpp", "#include \"fit/a.hpp\"\n#include \"hal/a.hpp\"\n"), IsEmpty());
  EXPECT_THAT(verdict("drivers/kinect2/x.cpp", "#include \"fit/gpu/a.hpp\"\n"), IsEmpty());
  EXPECT_THAT(verdict("daemon/drivers_factory.cpp", "#include \"drivers/usb/a.hpp\"\n"), IsEmpty());
  EXPECT_THAT(
      verdict("fit/x.cpp", "// #include \"hal/a.hpp\"\n/* #include \"daemon/a.hpp\" */\n/*\n#include <png.h>\n*/\nconst char* s = \"#include <png.h>\";\n"),
      IsEmpty());
}

TEST(IncludeCycles, AreFound) {
  EXPECT_THAT(include_cycles({{"a.hpp", "#include \"b.hpp\"\n"}, {"b.hpp", "#include \"c.hpp\"\n"}, {"c.hpp", "#include \"b.hpp\"\n"}}),
              ElementsAre("b.hpp -> c.hpp -> b.hpp"));
  EXPECT_THAT(include_cycles({{"a.hpp", "#include \"b.hpp\"\n#include \"c.hpp\"\n"}, {"b.hpp", "#include \"c.hpp\"\n"}, {"c.hpp", ""}}), IsEmpty());
}

}  // namespace
}  // namespace booth::tests
