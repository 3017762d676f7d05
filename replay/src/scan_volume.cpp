#include "scan_volume.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cerrno>
#include <cmath>

namespace tubetrack {

namespace {

constexpr std::size_t kBlock_bytes = 1U << 16U;
constexpr double kMaxCells_per_axis = 1e9;

/// Which values are the body, and what was seen of the values.
class BodyRule {
 public:
  explicit BodyRule(const ScanOptions& options) : label_(options.label), threshold_(options.threshold) {
    if (label_ && threshold_) {
      throw ScanRefusal{fmt::format("--label {:g} and --threshold {:g}: takes one of them", *label_, *threshold_),
                        Error::Kind::usage};
    }
  }

  bool is_body(double value) {
    if (std::isnan(value)) return false;
    lowest_ = std::min(lowest_, value);
    highest_ = std::max(highest_, value);
    if (label_) return value == *label_;
    if (threshold_) return value >= *threshold_;
    if (value == 0.0) return false;
    if (first_ == 0.0) first_ = value;
    if (value != first_ && second_ == 0.0) second_ = value;
    return true;
  }

  void check(std::size_t body, std::size_t all) const {
    if (second_ != 0.0) {
      throw ScanRefusal{
          fmt::format("the voxels have the values {:g}, {:g} and maybe more ({:g} to {:g}); give --label N "
                      "for one of them, or --threshold T",
                      first_, second_, lowest_, highest_),
          Error::Kind::usage};
    }
    if (body != 0 && body != all) return;
    const std::string rule = label_       ? fmt::format("--label {:g}", *label_)
                             : threshold_ ? fmt::format("--threshold {:g}", *threshold_)
                                          : std::string("not being 0");
    throw ScanRefusal{
        fmt::format("{} voxel is in the body by {}; the values go from {:g} to {:g}: give another --label "
                    "or --threshold",
                    body == 0 ? "no" : "every", rule, lowest_, highest_),
        label_ || threshold_ ? Error::Kind::usage : Error::Kind::failed};
  }

 private:
  std::optional<double> label_, threshold_;
  double first_ = 0.0, second_ = 0.0;  ///< the first two values that are not 0
  double lowest_ = std::numeric_limits<double>::infinity();
  double highest_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

ByteStream::ByteStream(const std::filesystem::path& path, std::uint64_t offset, bool compressed)
    : file_(path, std::ios::binary), compressed_(compressed), packed_(compressed ? kBlock_bytes : 0) {
  if (!file_) {
    throw ScanRefusal{fmt::format("{} cannot be opened: {}; check that it is there and readable", path.string(),
                                  std::strerror(errno))};
  }
  file_.seekg(static_cast<std::streamoff>(offset));
  constexpr int kGzipOrZlib = 32 + MAX_WBITS;
  if (compressed_ && inflateInit2(&inflater_, kGzipOrZlib) != Z_OK) throw ScanRefusal{"zlib cannot be started"};
}

ByteStream::~ByteStream() {
  if (compressed_) inflateEnd(&inflater_);
}

std::size_t ByteStream::read(char* to, std::size_t count) {
  if (!compressed_) {
    file_.read(to, static_cast<std::streamsize>(count));
    return static_cast<std::size_t>(file_.gcount());
  }
  std::size_t done = 0;
  while (done < count && !ended_) done += inflate_some(to + done, count - done);
  return done;
}

void ByteStream::refill() {
  const std::size_t left = inflater_.avail_in;
  std::copy_n(inflater_.next_in, left, reinterpret_cast<Bytef*>(packed_.data()));
  file_.read(packed_.data() + left, static_cast<std::streamsize>(packed_.size() - left));
  inflater_.next_in = reinterpret_cast<Bytef*>(packed_.data());
  inflater_.avail_in = static_cast<uInt>(left + static_cast<std::size_t>(file_.gcount()));
}

std::size_t ByteStream::inflate_some(char* to, std::size_t count) {
  if (inflater_.avail_in == 0) refill();
  if (inflater_.avail_in == 0) {
    ended_ = true;
    return 0;
  }
  const auto wanted = static_cast<uInt>(std::min<std::size_t>(count, 1U << 30U));
  inflater_.next_out = reinterpret_cast<Bytef*>(to);
  inflater_.avail_out = wanted;
  const int status = inflate(&inflater_, Z_NO_FLUSH);
  if (status == Z_STREAM_END) {
    // A gzip file may be several, one after the other. Anything else behind the end is padding.
    if (inflater_.avail_in < 2) refill();
    const bool more = inflater_.avail_in > 1 && inflater_.next_in[0] == 0x1f && inflater_.next_in[1] == 0x8b;
    ended_ = !more || inflateReset(&inflater_) != Z_OK;
  } else if (status != Z_OK && status != Z_BUF_ERROR) {
    throw ScanRefusal{fmt::format("compressed data are damaged ({}); copy or export it again",
                                  inflater_.msg != nullptr ? inflater_.msg : "zlib")};
  }
  return wanted - inflater_.avail_out;
}

void require_volume_fits(const std::array<long long, 3>& size, const VoxelEncoding& encoding, double data_bytes,
                         const ScanOptions& options) {
  double voxels = 1.0;
  for (const long long cells : size) {
    if (cells < 1 || static_cast<double>(cells) > kMaxCells_per_axis) {
      throw ScanRefusal{
          fmt::format("size: got {} x {} x {} voxels, takes at least 1 and at most {:g} each way; correct "
                      "the header",
                      size[0], size[1], size[2], kMaxCells_per_axis)};
    }
    voxels *= static_cast<double>(cells);
  }
  const auto limit =
      static_cast<double>(options.memory_limit_bytes != 0 ? options.memory_limit_bytes : default_memory_limit_bytes());
  if (voxels > limit) {
    throw ScanRefusal{
        fmt::format("size: {} x {} x {} voxels take {} of memory, takes at most {}; crop the volume or "
                    "make it coarser",
                    size[0], size[1], size[2], human_size(voxels), human_size(limit))};
  }
  if (data_bytes >= 0.0) require_room("voxels", voxels, static_cast<double>(size_of(encoding.type)), data_bytes);
}

void read_voxels(ByteStream& stream, const std::array<long long, 3>& size, const VoxelEncoding& encoding,
                 const ScanOptions& options, RawVolume& volume) {
  BodyRule rule(options);
  VoxelGrid& grid = volume.grid;
  grid.size = {static_cast<int>(size[0]), static_cast<int>(size[1]), static_cast<int>(size[2])};
  const std::size_t count =
      static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(size[2]);
  const std::size_t each_bytes = size_of(encoding.type);
  std::vector<char> block(kBlock_bytes);
  std::size_t body = 0;
  grid.inside.reserve(count);
  while (grid.inside.size() < count) {
    const std::size_t wanted = std::min(block.size() / each_bytes, count - grid.inside.size());
    const std::size_t got = stream.read(block.data(), wanted * each_bytes) / each_bytes;
    for (std::size_t i = 0; i < got; ++i) {
      const double stored = load_number(block.data() + i * each_bytes, encoding.type, encoding.swapped);
      const bool is_body = rule.is_body(encoding.slope * stored + encoding.intercept);
      body += is_body ? 1 : 0;
      grid.inside.push_back(is_body ? 1 : 0);
    }
    if (got < wanted) {
      throw ScanRefusal{fmt::format("ends after {} of {} voxels; it was cut off: copy or export it again",
                                    grid.inside.size(), count)};
    }
  }
  rule.check(body, count);
}

void require_axes(const Eigen::Matrix3d& axes, std::string_view field) {
  const double box = axes.col(0).norm() * axes.col(1).norm() * axes.col(2).norm();
  const double volume = std::abs(axes.determinant());
  if (std::isfinite(box) && box > 0.0 && volume > 1e-3 * box) return;
  throw ScanRefusal{
      fmt::format("{}: its three axes are ({:g} {:g} {:g}), ({:g} {:g} {:g}), ({:g} {:g} {:g}), which span "
                  "no volume; correct the header",
                  field, axes(0, 0), axes(1, 0), axes(2, 0), axes(0, 1), axes(1, 1), axes(2, 1), axes(0, 2), axes(1, 2),
                  axes(2, 2))};
}

}  // namespace tubetrack
