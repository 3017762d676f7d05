#include "scan_content.hpp"

#include <utility>

namespace tubetrack {

std::string_view ending_by_content(std::string_view first_bytes) {
  using namespace std::string_view_literals;
  constexpr std::pair<std::string_view, std::string_view> kBeginnings[] = {
      {"OFF"sv, ".off"},         {"COFF"sv, ".off"},       {"NOFF"sv, ".off"},   {"CNOFF"sv, ".off"},
      {"ply\n"sv, ".ply"},       {"ply\r"sv, ".ply"},      {"# .PCD"sv, ".pcd"}, {"solid "sv, ".stl"},
      {"\x89PNG\r\n"sv, ".png"}, {"P5\n"sv, ".pgm"},       {"II*\0"sv, ".tif"},  {"MM\0*"sv, ".tif"},
      {"\x1f\x8b"sv, ".nii.gz"}, {"ObjectType"sv, ".mhd"}, {"NDims"sv, ".mhd"},  {"Center-X:"sv, ".vol"}};
  for (const auto& [beginning, ending] : kBeginnings) {
    if (first_bytes.starts_with(beginning)) return ending;
  }
  constexpr std::size_t kNiftiMagic = 344;
  if (first_bytes.size() > kNiftiMagic && first_bytes.substr(kNiftiMagic).starts_with("n+1")) return ".nii";
  return {};
}

bool has_ending(std::string_view lower_case_name, std::string_view ending) {
  return lower_case_name.ends_with(ending) || (ending == ".tif" && lower_case_name.ends_with(".tiff")) ||
         (ending == ".mhd" && lower_case_name.ends_with(".mha"));
}

}  // namespace tubetrack
