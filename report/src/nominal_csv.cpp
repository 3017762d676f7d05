#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include "tubetrack/report/nominal.hpp"

namespace tubetrack {

namespace {

constexpr std::string_view kHead = "tube,point,x_m,y_m,z_m";

/// The five numbers of a line; false where they are not five numbers.
bool read_line(std::string_view line, std::array<double, 5>& numbers) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::size_t end = line.find(',');
    if ((end == std::string_view::npos) != (i + 1 == numbers.size())) return false;
    const std::string_view cell = line.substr(0, end);
    const auto [last, problem] = std::from_chars(cell.data(), cell.data() + cell.size(), numbers[i]);
    if (problem != std::errc() || last != cell.data() + cell.size() || !std::isfinite(numbers[i])) return false;
    line.remove_prefix(i + 1 == numbers.size() ? line.size() : end + 1);
  }
  return true;
}

}  // namespace

Expected<std::vector<NominalTube>> read_nominal_csv(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return tl::make_unexpected(Error::usage(fmt::format("{}: no such file, or not readable", path.string())));
  const auto refuse = [&](std::size_t number, const std::string& line, std::string_view takes) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}, line {}: \"{}\", takes {}", path.string(), number, line.substr(0, 60), takes)));
  };
  std::vector<NominalTube> tubes;
  std::string line;
  for (std::size_t number = 1; std::getline(file, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (number == 1 && line != kHead) return refuse(number, line, fmt::format("{}, as --xyz writes it", kHead));
    if (number == 1 || line.empty()) continue;
    std::array<double, 5> numbers{};
    if (!read_line(line, numbers)) return refuse(number, line, fmt::format("five numbers: {}", kHead));
    const auto id = static_cast<std::int64_t>(numbers[0]);
    if (tubes.empty() || tubes.back().id != id) tubes.push_back({id, {}});
    const Eigen::Vector3d point_m(numbers[2], numbers[3], numbers[4]);
    auto& xyz_m = tubes.back().xyz_m;
    if (!xyz_m.empty() && (xyz_m.back() - point_m).norm() < 1e-6)
      return refuse(number, line, "a point apart from the one before");
    xyz_m.push_back(point_m);
  }
  // Tubes that are bent are some metres long, or some thousand millimetres.
  constexpr double kMost_m = 100.0;
  for (const NominalTube& tube : tubes) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& point_m : tube.xyz_m) box.extend(point_m);
    if (const double span_m = box.diagonal().norm(); span_m > kMost_m)
      return tl::make_unexpected(
          Error::failed(fmt::format("{}: the points of tube {} span {:.0f} m, takes metres, at most {:g}: are they in "
                                    "millimetres?",
                                    path.string(), tube.id, span_m, kMost_m)));
    if (tube.xyz_m.size() < 2)
      return tl::make_unexpected(
          Error::failed(fmt::format("{}: tube {} has one point; give both ends at least", path.string(), tube.id)));
  }
  if (tubes.empty())
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: no points; takes a line {} and a line a point below it", path.string(), kHead)));
  return tubes;
}

}  // namespace tubetrack
