#pragma once

#include <string_view>

namespace tubetrack {

/// The ending that a scan's file should have by how it begins (".off", ".ply", …); empty where that tells nothing, as
/// of .obj, .xyz and binary .stl.
std::string_view ending_by_content(std::string_view first_bytes);

/// The name has that ending, or another one for the same format.
bool has_ending(std::string_view lower_case_name, std::string_view ending);

}  // namespace tubetrack
