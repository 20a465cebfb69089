// Names of the noise models; the drawing itself is in renderer.cpp.
#include "drivers/synthetic/noise.hpp"

#include <charconv>
#include <stdexcept>

namespace booth::drivers {

NoiseModel NoiseModel::parse(std::string_view text) {
  if (text == "none") return {Kind::none, 0};
  if (text == "kinect2") return {Kind::kinect2, 0};
  constexpr std::string_view prefix = "gaussian:";
  if (text.starts_with(prefix)) {
    const auto number = text.substr(prefix.size());
    double sigma = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), sigma);
    if (error == std::errc() && end == number.data() + number.size() && sigma >= 0 && sigma <= 1) return {Kind::gaussian, sigma};
  }
  throw std::invalid_argument("noise '" + std::string(text) + "' is not known; allowed are kinect2, none and gaussian:SIGMA with SIGMA in metres from 0 to 1");
}

std::string NoiseModel::to_string() const {
  if (kind == Kind::none) return "none";
  if (kind == Kind::kinect2) return "kinect2";
  return "gaussian:" + std::to_string(sigma);
}

}  // namespace booth::drivers
