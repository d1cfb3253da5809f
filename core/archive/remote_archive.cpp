#include "core/archive/remote_archive.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <future>

#include "core/archive/archive_metrics.h"
#include "core/archive/raw_call.h"
#include "core/archive/row_message.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/process/pause.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kSilenceTimeout(20);  // for a node that sends nothing; it may be verifying a large frame
constexpr int kTries = 4, kRounds = 2;  // per node whose connection breaks; over all nodes
constexpr milliseconds kFirstPause(100);
// Bytes of frames that a node verifies per LocateArchive call, within kLocateTime.
constexpr std::int64_t kLocatedBytes = std::int64_t{1} << 30;
constexpr seconds kLocateTime(60), kFirstLocateTime(2);

// A number of this process, for the order in which it asks nodes.
size_t own_number() {
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  return std::hash<std::string>()(fmt::format("{}:{}", host.data(), ::getpid()));
}

// True for errors of the call itself, rather than of the node's files.
bool is_broken(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsCancelled(status) ||
         absl::IsInternal(status) || absl::IsUnknown(status) || absl::IsResourceExhausted(status);
}

absl::Status naming(const std::string& what, const absl::Status& status) {
  return absl::Status(status.code(), fmt::format("{}: {}", what, std::string(status.message())));
}

}  // namespace

struct RemoteArchive::Source {
  explicit Source(const std::string& address)
      : peer("node at " + address),
        channel(dial(address, kArchiveKeepers)),
        stub(v1::ArchiveService::NewStub(channel)) {}

  absl::StatusOr<v1::LocateArchiveResponse> locate(const v1::LocateArchiveRequest& request, milliseconds time,
                                                   const std::stop_token& stop) const {
    v1::LocateArchiveResponse location;
    grpc::ClientContext context;
    set_deadline(context, time);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    GW_RETURN_IF_ERROR(from_grpc(stub->LocateArchive(&context, request, &location), peer));
    return location;
  }

  const std::string peer;
  const std::shared_ptr<grpc::Channel> channel;
  const std::unique_ptr<v1::ArchiveService::Stub> stub;
  bool is_here = false;                 // the node runs on this machine
  std::shared_ptr<LocalArchive> local;  // its directory, if visible here
};

struct RemoteArchive::Request {
  v1::ReadRowsRequest read;
  FrameShape shape;

  size_t row_bytes() const { return 2 * shape.row_samples(); }
  size_t frame_bytes() const { return static_cast<size_t>(read.row_count()) * row_bytes(); }
  size_t size_bytes() const { return frame_bytes() * static_cast<size_t>(read.files_size()); }
  const std::string& file_at(std::int64_t offset) const {
    return read.files(static_cast<int>(static_cast<size_t>(offset) / frame_bytes()));
  }
  static Request of(const std::string& session, const v1::CaptureManifest& manifest,
                    const std::vector<int>& frames, int first_row, int row_count) {
    Request request{.read = {}, .shape = shape_of(manifest.camera())};
    request.read.set_session(session);
    request.read.set_first_row(first_row);
    request.read.set_row_count(row_count);
    for (const int frame : frames) request.read.add_files(manifest.frames(frame).file());
    return request;
  }
};

absl::Status FrameRows::intact() const {
  if (std::ranges::all_of(
          mapped, &MappedFile::intact, [](const auto& file) -> auto& { return *file; }))
    return absl::OkStatus();
  return absl::UnavailableError(
      "a frame's file on this machine could not be read to its end while it was mapped");
}

RemoteArchive::RemoteArchive(const std::vector<std::string>& addresses, std::string session,
                             std::stop_token stop, Reading reading)
    : session_(std::move(session)), stop_(std::move(stop)), reading_(reading) {
  for (const std::string& address : addresses) sources_.push_back(std::make_unique<Source>(address));
  std::rotate(sources_.begin(), sources_.begin() + own_number() % sources_.size(), sources_.end());
}

RemoteArchive::~RemoteArchive() = default;

absl::StatusOr<v1::CaptureManifest> RemoteArchive::manifest() const {
  v1::GetManifestRequest get;
  get.set_session(session_);
  locate_archives();
  absl::Status failure;
  for (const auto& source : sources_) {
    v1::GetManifestResponse got;
    grpc::ClientContext context;
    set_deadline(context, kSilenceTimeout);
    const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
    const absl::Status status = from_grpc(source->stub->GetManifest(&context, get, &got), source->peer);
    if (status.ok()) return std::move(*got.mutable_manifest());
    // UNAVAILABLE says less about the archive than other errors, but may be temporary.
    if (failure.ok() || absl::IsUnavailable(status)) failure = status;
  }
  return failure;
}

void RemoteArchive::locate_archives() const {
  std::call_once(located_, [this] {
    v1::LocateArchiveRequest request;
    request.set_session(session_);
    std::vector<std::future<void>> asked;
    for (const auto& source : sources_) {
      asked.push_back(std::async(std::launch::async, [&, to = source.get()] {
        const absl::StatusOr<v1::LocateArchiveResponse> location =
            to->locate(request, kFirstLocateTime, stop_);
        if (!location.ok()) return;
        to->is_here = location->boot_id() == boot_id();
        if (reading_ == Reading::kMappedIfHere) to->local = LocalArchive::open(*location);
      }));
    }
    asked.clear();  // waits
    std::stable_partition(sources_.begin(), sources_.end(),
                          [](const auto& source) { return source->is_here; });
  });
}

absl::StatusOr<FrameRows> RemoteArchive::map(const Request& request, const Source& source) const {
  const int at_once = static_cast<int>(
      std::max<std::int64_t>(1, kLocatedBytes / static_cast<std::int64_t>(tiff_size_bytes(request.shape))));
  for (int first = 0; first < request.read.files_size(); first += at_once) {
    v1::LocateArchiveRequest verify;
    verify.set_session(session_);
    for (int i = first; i < std::min(first + at_once, request.read.files_size()); ++i)
      verify.add_files(request.read.files(i));
    GW_RETURN_IF_ERROR(source.locate(verify, kLocateTime, stop_).status());
  }
  struct Owner {
    std::vector<std::shared_ptr<const MappedFile>> mapped;
    std::vector<std::unique_ptr<std::uint16_t[]>> decompressed;
  };
  const auto owner = std::make_shared<Owner>();
  FrameRows rows;
  const size_t samples = request.frame_bytes() / 2;
  const int first_row = request.read.first_row(), row_count = request.read.row_count();
  for (const std::string& file : request.read.files()) {
    GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> mapped, source.local->map(file, request.shape));
    GW_ASSIGN_OR_RETURN(const TiffRows stored, TiffRows::open(mapped->bytes(), request.shape));
    if (!stored.plain().empty()) {
      const size_t first = static_cast<size_t>(first_row) * request.shape.row_samples();
      rows.rows.push_back(stored.plain().subspan(first, samples));
      rows.mapped.push_back(mapped);
      owner->mapped.push_back(std::move(mapped));
      continue;
    }
    const auto& to =
        owner->decompressed.emplace_back(std::make_unique_for_overwrite<std::uint16_t[]>(samples));
    GW_RETURN_IF_ERROR(stored.read(first_row, row_count, to.get()));
    if (!mapped->intact()) return absl::UnavailableError(file + " could not be read to its end");
    rows.rows.emplace_back(to.get(), samples);
  }
  rows.owner = owner;
  return rows;
}

absl::StatusOr<FrameRows> RemoteArchive::map_any(const Request& request) const {
  locate_archives();
  if (request.read.first_row() < 0 || request.read.row_count() < 1 ||
      request.read.first_row() > request.shape.height_px - request.read.row_count())
    return absl::InvalidArgumentError("no such rows");  // reading gives a better message
  for (const auto& source : sources_) {
    if (source->local == nullptr) continue;
    absl::StatusOr<FrameRows> rows = map(request, *source);
    if (!rows.ok()) continue;
    archive_metrics().bytes_read_local.Increment(static_cast<double>(request.size_bytes()));
    return rows;
  }
  return absl::NotFoundError("no archive on this machine");
}

// For a call that ended before everything was read.
RemoteArchive::Outcome RemoteArchive::outcome_of(const grpc::Status& end, const Source& source,
                                                 std::string_view what) {
  if (end.ok()) {
    return {absl::InternalError(fmt::format("{} sent fewer {} than requested", source.peer, what)),
            Next::kOther};
  }
  if (!is_broken(from_grpc(end))) return {naming(source.peer, from_grpc(end)), Next::kOnlyOthers};
  return {absl::UnavailableError(from_grpc(end, source.peer).message()), Next::kSame};
}

RemoteArchive::Outcome RemoteArchive::read_from(const Source& source, const Request& request,
                                                std::span<char> rows, std::int64_t& done) const {
  v1::ReadRowsRequest read = request.read;
  read.set_offset_bytes(done);
  RawCall call(source.channel, "ReadRows", read, kSilenceTimeout, stop_);
  for (grpc::ByteBuffer message; call.next(message); message.Clear()) {
    const std::string& file = request.file_at(done);
    archive_metrics().bytes_read_remote.Increment(static_cast<double>(message.Length()));
    const absl::Status taken = take_row_chunk(message, rows, done);
    if (!taken.ok()) return {naming(fmt::format("{} from the {}", file, source.peer), taken), Next::kOther};
    if (done == static_cast<std::int64_t>(rows.size())) return {absl::OkStatus(), Next::kNone};
  }
  return outcome_of(call.finish(), source, "rows");
}

RemoteArchive::Outcome RemoteArchive::read_file_from(const Source& source, const v1::Frame& record,
                                                     std::span<char> bytes, std::int64_t& done) const {
  v1::ReadFileRequest read;
  read.set_session(session_);
  read.set_file(record.file());
  read.set_offset_bytes(done);
  RawCall call(source.channel, "ReadFile", read, kSilenceTimeout, stop_);
  const std::string what = fmt::format("{} from the {}", record.file(), source.peer);
  for (grpc::ByteBuffer message; call.next(message); message.Clear()) {
    archive_metrics().bytes_read_remote.Increment(static_cast<double>(message.Length()));
    v1::ReadFileResponse piece;
    const bool parsed = grpc::SerializationTraits<v1::ReadFileResponse>::Deserialize(&message, &piece).ok();
    if (!parsed || piece.chunk().size() > bytes.size() - static_cast<size_t>(done)) {
      done = 0;
      return {absl::InternalError(fmt::format("{}: it sent more than {} bytes", what, bytes.size())),
              Next::kOther};
    }
    std::ranges::copy(piece.chunk(), bytes.begin() + done);
    done += static_cast<std::int64_t>(piece.chunk().size());
  }
  const grpc::Status end = call.finish();
  if (!end.ok() || done < static_cast<std::int64_t>(bytes.size())) return outcome_of(end, source, "bytes");
  if (const std::string checksum = checksum_of({bytes.data(), bytes.size()}); checksum != record.checksum()) {
    done = 0;
    return {absl::DataLossError(
                fmt::format("{} arrived with checksum {} instead of {}", what, checksum, record.checksum())),
            Next::kOther};
  }
  return {absl::OkStatus(), Next::kNone};
}

absl::Status RemoteArchive::read(const Request& request, std::span<char> rows) const {
  if (rows.empty()) return absl::OkStatus();
  return read_any(
      [&](const Source& source, std::int64_t& done) { return read_from(source, request, rows, done); });
}

absl::StatusOr<std::string> RemoteArchive::file(const v1::CaptureManifest& manifest, int frame) const {
  const v1::Frame& record = manifest.frames(frame);
  GW_ASSIGN_OR_RETURN(const size_t size_bytes,
                      listed_bytes(record, shape_of(manifest.camera()), record.file()));
  std::string bytes(size_bytes, '\0');
  GW_RETURN_IF_ERROR(read_any(
      [&](const Source& source, std::int64_t& done) { return read_file_from(source, record, bytes, done); }));
  return bytes;
}

absl::Status RemoteArchive::read_any(const Read& read) const {
  std::vector<Outcome> last(sources_.size());  // by node
  std::int64_t done = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (size_t i = 0; i < sources_.size(); ++i) {
      for (int attempt = 0; attempt < kTries && !stop_.stop_requested(); ++attempt) {
        if (last[i].next == Next::kOnlyOthers) break;
        if (attempt > 0) pause(stop_, kFirstPause * (1 << (attempt - 1)));
        const std::int64_t before = done;
        last[i] = read(*sources_[i], done);
        if (last[i].status.ok()) return absl::OkStatus();
        if (last[i].next != Next::kSame) break;
        if (done > before) attempt = 0;  // progress was made
      }
    }
  }
  if (stop_.stop_requested()) return absl::CancelledError("stopped");
  std::vector<std::string> what;
  absl::StatusCode code = last.front().status.code();
  for (const Outcome& outcome : last) {
    what.emplace_back(outcome.status.message());
    if (absl::IsDataLoss(outcome.status)) code = absl::StatusCode::kDataLoss;
  }
  // A node that may come back is worth waiting for, whatever the errors of the others.
  if (std::ranges::any_of(last, [](const Outcome& outcome) { return outcome.next == Next::kSame; }))
    code = absl::StatusCode::kUnavailable;
  return absl::Status(code, fmt::format("{}", fmt::join(what, "; ")));
}

absl::StatusOr<FrameRows> RemoteArchive::rows(const v1::CaptureManifest& manifest,
                                              const std::vector<int>& frames, int first_row,
                                              int row_count) const {
  const Request request = Request::of(session_, manifest, frames, first_row, row_count);
  if (absl::StatusOr<FrameRows> mapped = map_any(request); mapped.ok()) return mapped;
  const size_t frame_samples = request.frame_bytes() / 2;
  const std::shared_ptr<std::uint16_t[]> samples =
      std::make_shared_for_overwrite<std::uint16_t[]>(frame_samples * frames.size());
  GW_RETURN_IF_ERROR(read(request, {reinterpret_cast<char*>(samples.get()), request.size_bytes()}));
  FrameRows rows;
  for (size_t i = 0; i < frames.size(); ++i)
    rows.rows.emplace_back(samples.get() + i * frame_samples, frame_samples);
  rows.owner = samples;
  return rows;
}

absl::StatusOr<std::vector<std::uint16_t>> RemoteArchive::samples(const v1::CaptureManifest& manifest,
                                                                  const std::vector<int>& frames,
                                                                  int first_row, int row_count) const {
  const Request request = Request::of(session_, manifest, frames, first_row, row_count);
  std::vector<std::uint16_t> samples;
  if (const absl::StatusOr<FrameRows> mapped = map_any(request); mapped.ok()) {
    samples.reserve(request.size_bytes() / 2);
    for (const std::span<const std::uint16_t> rows : mapped->rows)
      samples.insert(samples.end(), rows.begin(), rows.end());
    if (mapped->intact().ok()) return samples;
  }
  samples.resize(request.size_bytes() / 2);
  GW_RETURN_IF_ERROR(read(request, {reinterpret_cast<char*>(samples.data()), request.size_bytes()}));
  return samples;
}

}  // namespace glasswing
