// boothctl calibrate in a folder of its own, which is gone afterwards.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace booth::tests {

struct Ran {
  int status = -1;
  std::string out, err;
};

struct CalibrateProgram {
  std::filesystem::path path;
  CalibrateProgram() {
    std::string name = (std::filesystem::temp_directory_path() / "boothd-calibrate-XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~CalibrateProgram() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  Ran run(const std::string& arguments) const {
    const std::string command = "cd '" + path.string() + "' && '" BOOTH_BINARY_DIR "/bin/boothctl' calibrate " + arguments + " 2>err";
    Ran ran;
    std::FILE* pipe = ::popen(command.c_str(), "r");
    std::array<char, 4096> part{};
    while (pipe != nullptr && std::fgets(part.data(), part.size(), pipe) != nullptr) ran.out += part.data();
    const int status = pipe != nullptr ? ::pclose(pipe) : -1;
    ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    std::ifstream err(path / "err");
    ran.err.assign(std::istreambuf_iterator<char>(err), {});
    return ran;
  }
};

}  // namespace booth::tests
