#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "scan_repair.hpp"
#include "vote_side.hpp"

namespace tubetrack {

namespace {

using Corners = std::array<std::uint32_t, 3>;

struct HalfEdge {
  std::uint64_t key;  ///< its two points, the lower first
  std::uint32_t face;
  bool forward;  ///< runs from the lower point to the higher
};

/// Across each of a face's edges, one neighbour or none; edges of three and more faces join nothing.
struct Neighbours {
  struct Link {
    std::uint32_t face = kNone;
    bool agrees = false;  ///< the two run through their edge in opposite directions, as they should
  };
  std::vector<std::array<Link, 3>> links;  ///< of each face, filled from the front
  std::vector<bool> has_loose_edge;        ///< an edge of one face, or of three and more
};

std::vector<HalfEdge> sorted_half_edges(const std::vector<Corners>& faces) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = faces[i][k], to = faces[i][(k + 1) % 3];
      edges.push_back({std::min(from, to) << 32U | std::max(from, to), static_cast<std::uint32_t>(i), from < to});
    }
  }
  std::sort(edges.begin(), edges.end(),
            [](const HalfEdge& a, const HalfEdge& b) { return a.key != b.key ? a.key < b.key : a.face < b.face; });
  return edges;
}

Neighbours neighbours_of(const std::vector<Corners>& faces) {
  const auto edges = sorted_half_edges(faces);
  Neighbours result{std::vector<std::array<Neighbours::Link, 3>>(faces.size()), std::vector<bool>(faces.size(), false)};
  const auto link = [&](std::uint32_t face, std::uint32_t other, bool agrees) {
    auto& links = result.links[face];
    const auto free = std::find_if(links.begin(), links.end(), [](const auto& one) { return one.face == kNone; });
    *free = {other, agrees};
  };
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && edges[end].key == edges[begin].key) ++end;
    if (end - begin == 2) {
      const bool agrees = edges[begin].forward != edges[begin + 1].forward;
      link(edges[begin].face, edges[begin + 1].face, agrees);
      link(edges[begin + 1].face, edges[begin].face, agrees);
    } else {
      for (std::size_t i = begin; i < end; ++i) result.has_loose_edge[edges[i].face] = true;
    }
  }
  return result;
}

/// Faces that hang together, and which of them to turn over so that all agree.
struct Piece {
  std::vector<std::uint32_t> faces;
  bool closed = true;
};

double area_of(const Scan& scan, const Corners& face) {
  const Eigen::Vector3d& a = scan.points_m[face[0]];
  return 0.5 * (scan.points_m[face[1]] - a).cross(scan.points_m[face[2]] - a).norm();
}

/// Walks over the mesh; `turned` gets 1 for a face to turn over. In each piece the larger area stays as it is.
std::vector<Piece> make_consistent(const Scan& scan, const Neighbours& neighbours, std::vector<std::uint8_t>& turned,
                                   std::size_t& contradictions) {
  std::vector<Piece> pieces;
  std::vector<bool> seen(scan.faces.size(), false);
  for (std::uint32_t start = 0; start < scan.faces.size(); ++start) {
    if (seen[start]) continue;
    Piece piece;
    piece.faces.push_back(start);
    seen[start] = true;
    double turned_area = 0.0, area = 0.0;
    for (std::size_t next = 0; next < piece.faces.size(); ++next) {
      const std::uint32_t face = piece.faces[next];
      const double own = area_of(scan, scan.faces[face]);
      area += own;
      if (turned[face] != 0) turned_area += own;
      if (neighbours.has_loose_edge[face]) piece.closed = false;
      for (const auto& link : neighbours.links[face]) {
        if (link.face == kNone) continue;
        const auto wanted = static_cast<std::uint8_t>(link.agrees ? turned[face] : 1 - turned[face]);
        if (!seen[link.face]) {
          seen[link.face] = true;
          turned[link.face] = wanted;
          piece.faces.push_back(link.face);
        } else if (turned[link.face] != wanted) {
          ++contradictions;  // both faces will count it: a Möbius strip has no two sides
        }
      }
    }
    if (2.0 * turned_area > area) {
      for (const std::uint32_t face : piece.faces) turned[face] = static_cast<std::uint8_t>(1 - turned[face]);
    }
    pieces.push_back(std::move(piece));
  }
  return pieces;
}

void turn_over(Corners& face) {
  std::swap(face[1], face[2]);
}

/// Six times the volume that a closed piece encloses; negative when its faces look inward.
double signed_volume(const Scan& scan, const Piece& piece) {
  const Eigen::Vector3d origin = scan.points_m[scan.faces[piece.faces.front()][0]];
  double volume = 0.0;
  for (const std::uint32_t face : piece.faces) {
    const auto& [a, b, c] = scan.faces[face];
    volume += (scan.points_m[a] - origin).dot((scan.points_m[b] - origin).cross(scan.points_m[c] - origin));
  }
  return volume;
}

VoteSide inner_side(const Scan& scan, const Piece& piece, double spacing_m) {
  if (piece.closed) return signed_volume(scan, piece) > 0.0 ? VoteSide::against_normals : VoteSide::along_normals;
  std::vector<OrientedPoint> points;
  points.reserve(piece.faces.size());
  for (const std::uint32_t face : piece.faces) {
    const auto& [a, b, c] = scan.faces[face];
    const Eigen::Vector3d &pa = scan.points_m[a], &pb = scan.points_m[b], &pc = scan.points_m[c];
    points.push_back({(pa + pb + pc) / 3.0, (pb - pa).cross(pc - pa).normalized()});
  }
  return concentrated_side(points, spacing_m);
}

}  // namespace

void orient_mesh(Scan& scan, double spacing_m) {
  std::vector<std::uint8_t> turned(scan.faces.size(), 0);
  std::size_t contradictions = 0;
  const std::vector<Piece> pieces = make_consistent(scan, neighbours_of(scan.faces), turned, contradictions);
  for (std::size_t i = 0; i < turned.size(); ++i) {
    if (turned[i] != 0) turn_over(scan.faces[i]);
  }
  const auto disagreeing = std::accumulate(turned.begin(), turned.end(), std::size_t{0});
  // Pieces that cannot be told, such as flat ones, go with those that can.
  std::vector<VoteSide> sides;
  double outward_faces = 0.0;
  std::size_t undecided = 0;
  for (const Piece& piece : pieces) {
    sides.push_back(inner_side(scan, piece, spacing_m));
    const auto count = static_cast<double>(piece.faces.size());
    if (sides.back() == VoteSide::undecided) undecided += piece.faces.size();
    if (sides.back() == VoteSide::against_normals) outward_faces += count;
    if (sides.back() == VoteSide::along_normals) outward_faces -= count;
  }
  std::size_t inverted = 0;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const bool inward = sides[i] == VoteSide::along_normals || (sides[i] == VoteSide::undecided && outward_faces < 0.0);
    if (!inward) continue;
    for (const std::uint32_t face : pieces[i].faces) turn_over(scan.faces[face]);
    inverted += pieces[i].faces.size();
  }
  const std::size_t all = scan.faces.size();
  if (disagreeing != 0)
    scan.notes.push_back(
        fmt::format("{} of {} faces were turned over to agree with their neighbours", disagreeing, all));
  if (inverted != 0) scan.notes.push_back(fmt::format("{} of {} faces looked inward: turned over", inverted, all));
  if (contradictions != 0)
    scan.notes.push_back(
        fmt::format("{} edges join faces that cannot agree (a surface with one side)", contradictions / 2));
  if (undecided != 0 && undecided == all)
    scan.notes.emplace_back("nothing tells the inside of this surface from its outside: taken as the file has it");
}

}  // namespace tubetrack
