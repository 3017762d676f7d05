#include <fmt/format.h>
#include <gmock/gmock.h>

#include <numbers>
#include <random>

#include "scan_files.hpp"
#include "tubetrack/replay/scan_surfels.hpp"

namespace tubetrack {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct Hostile {
  const char* name;
  std::string bytes;
  const char* says;
};
class HostileScan : public ::testing::TestWithParam<Hostile> {};

TEST_P(HostileScan, IsRefusedInOneLine) {
  const TemporaryFolder folder;
  write_bytes(folder / GetParam().name, GetParam().bytes);
  EXPECT_THAT(refusal_of(folder / GetParam().name), HasSubstr(GetParam().says));
}

std::string huge_nifti() {
  std::string bytes = nifti_bytes({30000, 30000, 30000}, {1, 1, 1}, "");
  return bytes;
}
std::string changed(std::string bytes, std::size_t at, const std::string& with) {
  return bytes.replace(at, with.size(), with);
}
const std::string kSmallNifti = nifti_bytes({4, 4, 4}, {1, 1, 1}, std::string(64, '\x01'));
const std::string kPcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kMhd = "NDims = 3\nDimSize = 4 4 4\n";

INSTANTIATE_TEST_SUITE_P(
    Meshes, HostileScan,
    ::testing::Values(
        Hostile{"empty.off", "", "is empty (0 bytes)"}, Hostile{"blank.off", "\n\n# nothing\n", "no line of content"},
        Hostile{"a.off", "hello", R"(got "hello", takes "OFF")"},
        Hostile{"counts.off", "OFF\n", "ends before the counts"},
        Hostile{"word.off", "OFF\nthree 1 0\n", R"(line 2: count of points: got "three")"},
        Hostile{"negative.off", "OFF\n-3 1 0\n", "the header says -3 points"},
        Hostile{"many.off", "OFF\n4000000000 1 0\n0 0 0\n",
                "the header says 4000000000 points, which take at least 24 GB"},
        Hostile{"cut.off", "OFF\n3 1 0\n0 0 0\n1 0 0            \n", "line 4: ends after 2 of 3 points"},
        Hostile{"nan.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n",
                "its point 1 (counted from 0) is (1, nan, 0)"},
        Hostile{"far.off", "OFF\n3 1 0\n0 0 0\n1e300 0 0\n0 1 0\n3 0 1 2\n", "takes coordinates below 1e9 m"},
        Hostile{"comma.off", "OFF\n3 1 0\n0 0 0\n1,5 0 0\n0 1 0\n3 0 1 2\n", R"(line 4: point: got "1,5")"},
        Hostile{"index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
                "line 6: corner: got point 3 (counted from 0), there are 3"},
        Hostile{"minus.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "got point -1"},
        Hostile{"corners.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n999999999 0 1 2\n", "999999999 corners of a face"},
        Hostile{"missing.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 6: corner: got nothing"},
        Hostile{"flat.off", "OFF\n3 1 0\n0 0 0\n1 1 1\n2 2 2\n3 0 1 2\n", "none of its faces has an area"},
        Hostile{"binary.off", "OFF BINARY\n3 1 0\n", "is a binary OFF"},
        Hostile{"index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: corner: got point 3"},
        Hostile{"zero.obj", "v 0 0 0\nf 0 1 2\n", R"(line 2: corner: got "0")"},
        Hostile{"back.obj", "v 0 0 0\nf -1 -2 -3\n", "got point -1"},
        Hostile{"none.obj", "mtllib a.mtl\n", "no line \"v x y z\""},
        Hostile{"short.stl", "abc", "has 3 bytes, takes at least 84"},
        Hostile{"cut.stl", std::string(80, ' ') + uint32_bytes(1000) + std::string(70, '\0'),
                "the header says 1000 faces"},
        Hostile{"end.stl", "solid a\nfacet normal 0 0 1\nvertex 0 0 0\n", "ends without \"endsolid\""},
        Hostile{"two.stl", "solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid\n",
                "got 2 corners"},
        Hostile{"none.stl", "solid a\nendsolid a\n", "has no points"}));

INSTANTIATE_TEST_SUITE_P(
    PlyFiles, HostileScan,
    ::testing::Values(
        Hostile{"a.ply", "plain text", "takes \"ply\""},
        Hostile{"header.ply", "ply\nformat ascii 1.0\n", "ends in its header"},
        Hostile{"format.ply", "ply\nelement vertex 0\nend_header\n", "format: is missing"},
        Hostile{"type.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty real x\n",
                R"(property type: got "real")"},
        Hostile{"y.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n",
                "takes one property y"},
        Hostile{"cut.ply", kPly + "end_header\n0 0 0\n1 0 0          \n", "ends after 2 of 3 of element \"vertex\""},
        Hostile{"many.ply",
                "ply\nformat binary_little_endian 1.0\nelement vertex 3000000000\nproperty float x\nproperty float "
                "y\nproperty float z\nend_header\n0000",
                "3000000000 of element \"vertex\", which take at least 36 GB"},
        Hostile{"list.ply",
                "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty "
                "float "
                "z\nelement face 1\nproperty list int int vertex_indices\nend_header\n" +
                    uint32_bytes(0x7fffffffU),
                "2147483647 numbers in \"vertex_indices\""},
        Hostile{"minus.ply",
                "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty "
                "float "
                "z\nelement face 1\nproperty list int int vertex_indices\nend_header\n" +
                    uint32_bytes(0xffffffffU),
                "-1 numbers in"},
        Hostile{"empty.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "takes one property x"},
        Hostile{"void.ply", "ply\nformat binary_big_endian 1.0\nelement junk 9000000000\nend_header\n",
                "has no properties"},
        Hostile{"novertex.ply", "ply\nformat ascii 1.0\nend_header\n", "element \"vertex\": is missing"},
        Hostile{
            "index.ply",
            kPly + "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
            "face 0: corner: got point 7"},
        Hostile{"noface.ply", kPly + "element face 1\nproperty int a\nend_header\n0 0 0\n1 0 0\n0 1 0\n3\n",
                "takes a property list"},
        Hostile{"nan.ply", kPly + "end_header\nnan 0 0\nnan 0 0\ninf 0 0\n", "has 0 different finite points"}));

INSTANTIATE_TEST_SUITE_P(
    Clouds, HostileScan,
    ::testing::Values(Hostile{"a.xyz", "1 2 3\n4 5\n", "line 2: got 2 number(s), takes 3"},
                      Hostile{"word.xyz", "1 2 3\n4 five 6\n", R"(line 2: column 2: got "five")"},
                      Hostile{"comma.xyz", "1,5 2,5 3,5\n", R"(line 1: got "1,5", takes decimal points)"},
                      Hostile{"text.txt", "Dear all,\nno points here.\n", "no line of three numbers"},
                      Hostile{"binary.xyz", std::string(100, '\0'), "no line of three numbers"},
                      Hostile{"a.pcd", "VERSION 0.7\n", "no line \"DATA"},
                      Hostile{"fields.pcd", "FIELDS x y z\nSIZE 4 4\nTYPE F F F\nWIDTH 1\nPOINTS 1\nDATA ascii\n",
                              "got 3, 2, 3 and 0 entries"},
                      Hostile{"z.pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nWIDTH 1\nPOINTS 1\nDATA ascii\n0 0 0 0 0\n",
                              "\"z\" is missing"},
                      Hostile{"points.pcd", kPcd + "WIDTH 10\nHEIGHT 2\nPOINTS 30\nDATA ascii\n",
                              "POINTS: got 30, but WIDTH x HEIGHT is 10 x 2"},
                      Hostile{"overflow.pcd", kPcd + "WIDTH 9000000000000000000\nHEIGHT 9\nPOINTS 30\nDATA ascii\n",
                              "POINTS: got 30, but"},
                      Hostile{"cut.pcd", kPcd + "WIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n0 0 0              \n",
                              "ends after 1 of 3 points"},
                      Hostile{"many.pcd", kPcd + "WIDTH 2000000000\nHEIGHT 1\nPOINTS 2000000000\nDATA binary\nabc",
                              "2000000000 points, which take at least 24 GB"},
                      Hostile{"packed.pcd",
                              kPcd + "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n" + uint32_bytes(4) +
                                  uint32_bytes(99) + "abcd",
                              "got 99 bytes, the header's fields and points take 24"},
                      Hostile{"damaged.pcd",
                              kPcd + "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n" + uint32_bytes(4) +
                                  uint32_bytes(24) + "\xff\xff\xff\xff",
                              "compressed points: damaged"},
                      Hostile{"data.pcd", kPcd + "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA gzip\n", "DATA: got \"gzip\""},
                      Hostile{"type.pcd", "FIELDS x y z\nSIZE 3 4 4\nTYPE F F F\nWIDTH 1\nPOINTS 1\nDATA ascii\n",
                              "got \"F\" of 3 bytes"}));

INSTANTIATE_TEST_SUITE_P(
    Volumes, HostileScan,
    ::testing::Values(
        Hostile{"huge.nii.gz", deflated(huge_nifti(), true), "30000 x 30000 x 30000 voxels take 27 TB of memory"},
        Hostile{"huge.nii", huge_nifti(), "30000 x 30000 x 30000 voxels take 27 TB of memory"},
        Hostile{"a.nii", "short", "ends in its header"},
        Hostile{"magic.nii", std::string(400, 'x'), "magic: takes \"n+1\""},
        Hostile{"two.nii", uint32_bytes(540) + std::string(600, '\0'), "is NIfTI-2"},
        Hostile{"series.nii", changed(changed(kSmallNifti, 40, uint16_bytes(4)), 48, uint16_bytes(9)), "dim[4]: got 9"},
        Hostile{"dims.nii", changed(kSmallNifti, 40, uint16_bytes(99)), "dim[0]: got 99"},
        Hostile{"negative.nii", changed(kSmallNifti, 42, uint16_bytes(0xFFFF)), "got -1 x 4 x 4 voxels"},
        Hostile{"type.nii", changed(kSmallNifti, 70, uint16_bytes(128)), "datatype: got 128"},
        Hostile{"spacing.nii", changed(kSmallNifti, 84, float_bytes(0.0F)), "span no volume"},
        Hostile{"offset.nii", changed(kSmallNifti, 108, float_bytes(-5.0F)), "vox_offset: got -5"},
        Hostile{"far.nii", changed(kSmallNifti, 108, float_bytes(5e8F)), "ends before its voxels"},
        Hostile{"full.nii", kSmallNifti, "every voxel is in the body by not being 0"},
        Hostile{"cut.nii", kSmallNifti.substr(0, 380),
                "64 voxels, which take at least 64 bytes, but only 28 bytes follow"},
        Hostile{"cut.nii.gz",
                deflated(nifti_bytes({40, 40, 12}, {1, 1, 1}, torus_voxels(40, 12, 13, 4)), true).substr(0, 300),
                "was cut off"},
        Hostile{"damaged.nii.gz", changed(deflated(kSmallNifti, true), 12, "\xff\xff\xff\xff\xff"),
                "compressed data are damaged"},
        Hostile{"a.vol", "X: 4\nY: 4\n", "ends with a line \".\""},
        Hostile{"bytes.vol", "X: 4\nY: 4\nZ: 4\nVoxel-Size: 2\n.\n", "Voxel-Size: got 2 bytes a voxel"},
        Hostile{"cut.vol", "X: 4\nY: 4\nZ: 4\nVersion: 2\n.\nabc",
                "64 voxels, which take at least 64 bytes, but only 3 bytes"},
        Hostile{"huge.vol", "X: 900000\nY: 900000\nZ: 900000\nVersion: 3\n.\nabc", "take 7.29e+05 TB of memory"},
        Hostile{"nodims.vol", "Version: 2\n.\nabc", "got 0 x 0 x 0 voxels"},
        Hostile{"a.mhd", "hello\n", "takes \"Key = value\""},
        Hostile{"nothing.mhd", "NDims = 3\n", "ElementDataFile: is missing"},
        Hostile{"gone.mhd", kMhd + "ElementType = MET_UCHAR\nElementDataFile = gone.raw\n", "gone.raw cannot be read"},
        Hostile{"type.mhd", kMhd + "ElementType = MET_STRING\nElementDataFile = LOCAL\n",
                "ElementType: got \"MET_STRING\""},
        Hostile{"dims.mhd", "NDims = 3\nDimSize = 4 4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
                "DimSize: got \"4 4\", takes 3 numbers"},
        Hostile{"cut.mhd", kMhd + "ElementType = MET_SHORT\nElementDataFile = LOCAL\nabcd",
                "64 voxels, which take at least 128 bytes, but only 4 bytes"},
        Hostile{"space.mhd", kMhd + "ElementSpacing = 1 -1 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
                "ElementSpacing: got -1"},
        Hostile{"axes.mhd",
                kMhd + "TransformMatrix = 1 0 0 1 0 0 0 0 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
                "span no volume"}));

TEST(HostileScans, AWrongNameIsAUsageError) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.docx", "text");
  const auto wrong = read_scan(folder / "a.docx", {});
  ASSERT_FALSE(wrong.has_value());
  EXPECT_EQ(wrong.error().kind, Error::Kind::usage);
  EXPECT_THAT(wrong.error().message, AllOf(HasSubstr("extension \".docx\""), HasSubstr(".off .obj .ply .stl")));
  EXPECT_THAT(refusal_of(folder / "missing.off"), HasSubstr("no such file"));
  EXPECT_THAT(refusal_of(folder.path()), HasSubstr("is a folder"));
  write_bytes(folder / "mesh.stl", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" + std::string(80, ' '));
  EXPECT_THAT(refusal_of(folder / "mesh.stl"), HasSubstr("is named .stl but begins as .off does; rename it"));
}

TEST(HostileScans, MemoryIsLimited) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.off", off_text(tube_mesh({})));
  write_bytes(folder / "a.nii", nifti_bytes({40, 40, 12}, {1, 1, 1}, torus_voxels(40, 12, 13, 4)));
  ScanOptions options;
  options.memory_limit_bytes = 10'000;
  EXPECT_THAT(refusal_of(folder / "a.off", options), HasSubstr("takes at most 10 KB"));
  EXPECT_THAT(refusal_of(folder / "a.nii", options),
              HasSubstr("40 x 40 x 12 voxels take 19.2 KB of memory, takes at most 10 KB"));
}

/// Two hundred damaged copies of each good file: read or refused, in bounded time, never a crash.
TEST(HostileScans, DamagedFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  const TestMesh mesh = tube_mesh({60, 10, 3, 2 * std::numbers::pi, 8, 6});
  const std::string voxels = torus_voxels(20, 8, 6.0, 2.5);
  std::string pcd = kPcd + fmt::format("WIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA binary\n", mesh.points.size());
  for (const auto& point : mesh.points) {
    for (const double x : point) pcd += float_bytes(static_cast<float>(x));
  }
  const std::vector<std::pair<std::string, std::string>> good = {
      {"a.off", off_text(mesh)},
      {"a.obj", obj_text(mesh)},
      {"text.stl", ascii_stl(mesh)},
      {"a.stl", binary_stl(mesh)},
      {"text.ply", ply_bytes(mesh, "ascii")},
      {"a.ply", ply_bytes(mesh, "binary_little_endian")},
      {"a.pcd", pcd},
      {"a.nii", nifti_bytes({20, 20, 8}, {1, 1, 1}, voxels)},
      {"a.nii.gz", deflated(nifti_bytes({20, 20, 8}, {1, 1, 1}, voxels), true)},
      {"a.vol", "X: 20\nY: 20\nZ: 8\nVoxel-Size: 1\nVersion: 2\n.\n" + voxels},
      {"a.mha", "NDims = 3\nDimSize = 20 20 8\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + voxels}};
  std::mt19937 random(11);
  for (const auto& [name, bytes] : good) {
    int read = 0;
    for (int trial = 0; trial < 200; ++trial) {
      std::string damaged = bytes;
      const std::size_t head = std::min<std::size_t>(damaged.size(), trial % 2 == 0 ? 400 : damaged.size());
      for (int k = 0; k < 1 + trial % 4; ++k) damaged[random() % head] = static_cast<char>(random());
      if (trial % 5 == 0) damaged.resize(random() % damaged.size());
      write_bytes(folder / name, damaged);
      ScanOptions options;
      options.memory_limit_bytes = 100'000'000;
      const auto scan = read_scan(folder / name, options);
      if (!scan) {
        ASSERT_EQ(scan.error().message.find('\n'), std::string::npos) << scan.error().message;
        continue;
      }
      ++read;
      ScanSurfelOptions few;
      few.max_count = 10'000;
      for (const ScanSurfel& surfel : surfels_of(*scan, few)) ASSERT_TRUE(surfel.inward_normal.allFinite());
    }
    std::printf("%-10s 200 damaged copies: %d read all the same\n", name.c_str(), read);
  }
}

}  // namespace
}  // namespace tubetrack
