// glasswing-raw: LibRaw, in a separate process (raw_photograph.h).
#include <fmt/format.h>
#include <libraw/libraw.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>

#include "core/image/raw_answer.h"
#include "core/image/raw_photograph.h"

namespace glasswing {
namespace {

constexpr int kMaxSide_px = 16384;

// Records reads that begin past the file's end: LibRaw fills the rest arbitrarily.
class Source final : public LibRaw_buffer_datastream {
 public:
  explicit Source(std::string_view bytes)
      : LibRaw_buffer_datastream(const_cast<char*>(bytes.data()), bytes.size()) {}
  int read(void* to, size_t each, size_t count) override {
    if (each * count > 0 && tell() >= size()) ++reads_beyond_;
    return LibRaw_buffer_datastream::read(to, each, count);
  }
  int get_char() override {
    const int byte = LibRaw_buffer_datastream::get_char();
    reads_beyond_ += byte < 0;
    return byte;
  }
  void begin() { reads_beyond_ = 0; }
  // Decoders of bits read a few ahead.
  bool was_cut_off() const { return reads_beyond_ > 16; }

 private:
  int reads_beyond_ = 0;
};

absl::Status bad(const std::string& what) {
  return absl::DataLossError(what);
}

absl::Status failed(int error) {
  if (error == LIBRAW_SUCCESS) return absl::OkStatus();
  return bad(error == LIBRAW_FILE_UNSUPPORTED
                 ? "it is not a raw photograph that LibRaw supports"
                 : fmt::format("it is damaged, or truncated ({})", libraw_strerror(error)));
}

class Reader {
 public:
  explicit Reader(std::string_view bytes) : source_(bytes), raw_(std::make_unique<LibRaw>()) {
    raw_->imgdata.params.max_raw_memory_mb = static_cast<unsigned>(kMaxRawBytes >> 20);
    raw_->imgdata.params.use_dngsdk = 0;
    raw_->set_dataerror_handler([](void* damaged, const char*, int) { *static_cast<bool*>(damaged) = true; },
                                &damaged_);
  }

  absl::Status open() {
    if (const absl::Status opened = failed(raw_->open_datastream(&source_)); !opened.ok()) return opened;
    const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
    const libraw_image_sizes_t& sizes = raw_->imgdata.sizes;
    for (const auto& [width, height] :
         {std::pair(sizes.raw_width, sizes.raw_height), std::pair(sizes.width, sizes.height)}) {
      if (good(width) && good(height)) continue;
      return bad(
          fmt::format("its header says {}x{}; each side must be 1 to {} px", width, height, kMaxSide_px));
    }
    return absl::OkStatus();
  }

  RawFacts facts() const {
    RawFacts facts;
    facts.turned = raw_->imgdata.sizes.flip != 0;
    const libraw_imgother_t& noted = raw_->imgdata.other;
    // As the camera wrote it, which a float cannot represent.
    if (noted.shutter > 0.0f) facts.exposure_ms = 1e3 * std::stod(fmt::format("{:.6g}", noted.shutter));
    if (noted.iso_speed > 0.0f) facts.iso = static_cast<double>(noted.iso_speed);
    return facts;
  }

  absl::StatusOr<RawPhotograph> photograph() {
    RawPhotograph photograph;
    photograph.facts = facts();
    if (const absl::Status known = find_mosaic(photograph.mosaic); !known.ok()) return known;
    libraw_decoder_info_t decoder{};
    raw_->get_decoder_info(&decoder);
    // LibRaw would read them as if they were rows.
    if (decoder.decoder_name == std::string_view("packed_dng_load_raw()") &&
        raw_->get_internal_data_pointer()->unpacker_data.tile_length < raw_->imgdata.sizes.raw_height)
      return bad(
          "its picture is stored in tiles without compression, which LibRaw does not support; write it "
          "with lossless compression, or in strips");
    damaged_ = false;
    source_.begin();
    if (const absl::Status unpacked = failed(raw_->unpack()); !unpacked.ok()) return unpacked;
    if (damaged_ || source_.was_cut_off()) return bad("it is damaged, or truncated");
    if (raw_->imgdata.rawdata.raw_image == nullptr)
      return bad("it contains interpolated colours; write a raw file with the sensor's own");
    if (const absl::Status copied = copy(photograph); !copied.ok()) return copied;
    return photograph;
  }

 private:
  // "RGGB", by the first two rows of two; empty: none.
  absl::Status find_mosaic(std::string& mosaic) const {
    const libraw_iparams_t& kind = raw_->imgdata.idata;
    if (kind.filters == 0 && kind.colors == 1) return absl::OkStatus();
    constexpr std::array<std::string_view, 4> kBayer{"RGGB", "GRBG", "GBRG", "BGGR"};
    // Small numbers denote larger patterns; a rotated sensor's rows are diagonals.
    if (kind.filters > 1000 && raw_->is_fuji_rotated() == 0) {
      for (int i = 0; i < 16; ++i) mosaic += kind.cdesc[raw_->COLOR(i / 2, i % 2)];
      const std::string four = mosaic.substr(0, 4);
      const bool repeats = mosaic == four + four + four + four;
      mosaic = four;
      if (repeats && std::ranges::find(kBayer, four) != kBayer.end()) return absl::OkStatus();
    }
    return bad("its photosites have a pattern other than RGGB, GRBG, GBRG or BGGR");
  }

  // The code without light at a photosite.
  int black_at(int x, int y) const {
    const libraw_colordata_t& colour = raw_->imgdata.color;
    unsigned black = colour.black;
    if (raw_->imgdata.idata.filters != 0) black += colour.cblack[raw_->COLOR(y, x)];
    const unsigned rows = colour.cblack[4], columns = colour.cblack[5];
    if (rows > 0 && columns > 0)
      black +=
          colour.cblack[6 + static_cast<unsigned>(y) % rows * columns + static_cast<unsigned>(x) % columns];
    return static_cast<int>(std::min(black, 65535u));
  }

  absl::Status copy(RawPhotograph& photograph) const {
    const libraw_image_sizes_t& sizes = raw_->imgdata.sizes;
    const int width = sizes.width, height = sizes.height;
    const size_t stride = sizes.raw_pitch / sizeof(std::uint16_t);
    if (sizes.left_margin + width > sizes.raw_width || sizes.top_margin + height > sizes.raw_height ||
        stride < sizes.raw_width)
      return bad("its header is damaged: the picture lies outside the sensor");
    // A pattern that LibRaw holds has at most this many places.
    const libraw_colordata_t& colour = raw_->imgdata.color;
    if (std::uint64_t{colour.cblack[4]} * colour.cblack[5] > LIBRAW_CBLACK_SIZE - 6)
      return bad("its header is damaged: its black levels repeat after too many photosites");
    const int columns = std::min(width, std::max<int>(2, static_cast<int>(colour.cblack[5]) * 2)),
              rows = std::min(height, std::max<int>(2, static_cast<int>(colour.cblack[4]) * 2));
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) photograph.black = std::max(photograph.black, black_at(x, y));
    }
    photograph.white = static_cast<int>(std::min(colour.maximum, 65535u));
    if (photograph.white <= photograph.black) {
      return bad(fmt::format("its header says that white is code {} and black {}; white must be higher",
                             photograph.white, photograph.black));
    }
    photograph.codes = Image16(width, height, 1);
    for (int y = 0; y < height; ++y) {
      const std::uint16_t* from = raw_->imgdata.rawdata.raw_image +
                                  static_cast<size_t>(y + sizes.top_margin) * stride + sizes.left_margin;
      for (int x = 0; x < width; ++x) {
        const int code = from[x] + photograph.black - black_at(x, y);
        photograph.codes.at(x, y, 0) = static_cast<std::uint16_t>(std::min(code, 65535));
      }
    }
    return absl::OkStatus();
  }

  Source source_;
  bool damaged_ = false;
  std::unique_ptr<LibRaw> raw_;  // large, and destroyed before what it reads
};

// The content of `bytes`; `facts_only`: without the picture.
absl::StatusOr<RawPhotograph> read_raw(std::string_view bytes, bool facts_only) {
  try {
    Reader reader(bytes);
    if (const absl::Status opened = reader.open(); !opened.ok()) return opened;
    if (!facts_only) return reader.photograph();
    RawPhotograph photograph;
    photograph.facts = reader.facts();
    return photograph;
  } catch (const std::exception& error) {
    return bad(fmt::format("it is damaged ({})", error.what()));
  }
}

// A crafted file may make LibRaw request any amount of memory.
void limit_resources() {
  constexpr rlim_t kMemory = rlim_t{3} << 30, kSeconds = 60;
  for (const auto& [what, most] :
       {std::pair(RLIMIT_AS, kMemory), std::pair(RLIMIT_CPU, kSeconds), std::pair(RLIMIT_CORE, rlim_t{0})}) {
    const rlimit limit{.rlim_cur = most, .rlim_max = most};
    (void)::setrlimit(what, &limit);
  }
}

bool write_all(const void* from, size_t size) {
  return std::fwrite(from, 1, size, stdout) == size;
}

}  // namespace
}  // namespace glasswing

// glasswing-raw photograph|facts: reads a file from standard input.
int main(int argc, char** argv) {
  using namespace glasswing;
  if (argc != 2) return 2;
  limit_resources();
  std::string bytes;
  std::array<char, 1 << 16> piece{};
  while (const size_t got = std::fread(piece.data(), 1, piece.size(), stdin)) bytes.append(piece.data(), got);
  const absl::StatusOr<RawPhotograph> raw = read_raw(bytes, std::string_view(argv[1]) == "facts");
  RawAnswer answer;
  if (!raw.ok()) {
    raw.status().message().copy(answer.refused.data(), answer.refused.size() - 1);
    return write_all(&answer, sizeof answer) && std::fflush(stdout) == 0 ? 0 : 1;
  }
  answer.width_px = raw->codes.width_px;
  answer.height_px = raw->codes.height_px;
  answer.black = raw->black;
  answer.white = raw->white;
  answer.exposure_ms = raw->facts.exposure_ms.value_or(0.0);
  answer.iso = raw->facts.iso.value_or(0.0);
  answer.turned = raw->facts.turned ? 1 : 0;
  raw->mosaic.copy(answer.mosaic.data(), answer.mosaic.size() - 1);
  const bool written =
      write_all(&answer, sizeof answer) &&
      write_all(raw->codes.samples.data(), raw->codes.samples.size() * sizeof(std::uint16_t));
  return written && std::fflush(stdout) == 0 ? 0 : 1;
}
