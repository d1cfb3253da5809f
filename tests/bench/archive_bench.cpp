// The rate of reading regions of frames over loopback, relative to a plain TCP connection with the same
// bytes. Both alternate, and the median of the rounds counts.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <functional>
#include <iostream>
#include <random>
#include <thread>

#include "core/archive/archive_service.h"
#include "core/archive/remote_archive.h"
#include "core/process/freed_memory.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "tests/bench/rows.h"
#include "tests/core/frame/archive_rows.h"
#include "tests/core/security/made_certificates.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 2000, kHeight = 1500, kFrames = 24;
constexpr int kBandRows = 32;

struct Options {
  int rounds = 9;
};

// ---- The plain connection

int listening(sockaddr_in& address) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener, 1) != 0 ||
      ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    std::abort();
  return listener;
}

void send_all(int to, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::write(to, bytes.data(), bytes.size());
    if (sent <= 0) std::abort();
    bytes.remove_prefix(sent);
  }
}

// Copies pieces of mapped files into one buffer, each way as much at once as the system accepts.
void plain_copy(const std::vector<std::string_view>& pieces, size_t size) {
  sockaddr_in address;
  const int listener = listening(address);
  const int to = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::connect(to, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) std::abort();
  const int from = ::accept(listener, nullptr, nullptr);
  const auto buffer = std::make_unique_for_overwrite<char[]>(size);
  {
    const std::jthread sender([&] {
      for (const std::string_view piece : pieces) send_all(to, piece);
    });
    for (size_t at = 0; at < size;) {
      const ssize_t got = ::read(from, buffer.get() + at, size - at);
      if (got <= 0) std::abort();
      at += static_cast<size_t>(got);
    }
  }
  for (const int fd : {listener, to, from}) ::close(fd);
}

// ---- The former way: pixels as a field of a message, copied at every step

// Serves ReadRows as a message with a field of bytes, without checksums.
class FieldService final : public v1::ArchiveService::Service {
 public:
  explicit FieldService(Archive& archive) : archive_(archive) {}
  grpc::Status ReadRows(grpc::ServerContext*, const v1::ReadRowsRequest* request,
                        grpc::ServerWriter<v1::ReadRowsResponse>* writer) override {
    std::int64_t start = 0;
    for (const std::string& file : request->files()) {
      const std::string rows = read_rows(archive_, file, request->first_row(), request->row_count()).value();
      for (size_t at = 0; at < rows.size(); at += kChunkBytes) {
        v1::ReadRowsResponse response;
        response.set_offset_bytes(start + static_cast<std::int64_t>(at));
        response.set_chunk(rows.substr(at, kChunkBytes));
        if (!writer->Write(response)) return grpc::Status::OK;
      }
      start += static_cast<std::int64_t>(rows.size());
    }
    return grpc::Status::OK;
  }

 private:
  Archive& archive_;
};

void read_fields(v1::ArchiveService::Stub& stub, const v1::ReadRowsRequest& request, size_t size) {
  const auto buffer = std::make_unique_for_overwrite<char[]>(size);
  grpc::ClientContext context;
  const auto reader = stub.ReadRows(&context, request);
  size_t received = 0;
  for (v1::ReadRowsResponse response; reader->Read(&response);) {
    std::ranges::copy(response.chunk(), buffer.get() + response.offset_bytes());
    received += response.chunk().size();
  }
  if (!reader->Finish().ok() || received != size) std::abort();
}

// ----

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

struct Bench {
  fs::path directory;
  std::unique_ptr<ArchiveStore> store;
  std::shared_ptr<Archive> archive;
  v1::CaptureManifest manifest;

  explicit Bench(const fs::path& root) : directory(root), store(std::make_unique<ArchiveStore>(root)) {
    v1::CaptureManifest header;
    header.set_session("bench");
    header.mutable_camera()->set_width_px(kWidth);
    header.mutable_camera()->set_height_px(kHeight);
    archive = store->create(header).value();
    std::mt19937 random(1);
    for (int i = 0; i < kFrames; ++i) {
      Archive::NewFrame frame{.record = {}, .image = Image16(kWidth, kHeight)};
      frame.record.set_step(i);
      frame.record.mutable_stimulus()->set_kind("solid");
      for (std::uint16_t& sample : frame.image.samples) sample = static_cast<std::uint16_t>(random());
      if (!archive->add({std::move(frame)}).ok()) std::abort();
    }
    manifest = archive->manifest();
    for (const v1::Frame& frame : manifest.frames())
      if (!archive->map(frame.file()).ok()) std::abort();  // verified, and in the page cache
  }
};

struct Region {
  std::string name, row;
  int first_row, row_count, repeats;
};

// Processor time of all threads of this process, which unlike elapsed time does not depend on other load.
double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// The rounds of one way.
struct Times {
  std::vector<double> seconds, cpu_seconds;

  void measure(int repeats, const std::function<void()>& once) {
    const double cpu = glasswing::cpu_seconds();
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < repeats; ++i) once();
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    cpu_seconds.push_back(glasswing::cpu_seconds() - cpu);
  }
};

// Returns the share of plain TCP's rate.
double report(const std::string& name, double bytes, const Times& times, const Times& plain) {
  std::vector<double> ratios;
  for (size_t i = 1; i < times.seconds.size(); ++i) ratios.push_back(plain.seconds[i] / times.seconds[i]);
  std::cout << fmt::format("{:44} {:6.2f} GB/s  {:5.2f} of plain TCP  {:6.2f} CPU s/GB\n", name,
                           bytes / median(times.seconds) / 1e9, median(ratios),
                           median(times.cpu_seconds) / bytes * 1e9);
  return median(ratios);
}

// Makes this process's calls use TLS from now on, to servers of this process.
std::shared_ptr<grpc::ServerCredentials> made_credentials(const fs::path& root) {
  const MadeCertificate ca = make_certificate("ca"),
                        own = make_certificate("node", &ca, "IP:127.0.0.1,URI:urn:glasswing:role:solver");
  const std::string ca_file = (root / "ca.pem").string();
  std::ofstream(ca_file) << ca.certificate_pem();
  if (!use_tls({.ca = ca_file, .certificate = "", .key = ""}).ok()) std::abort();
  grpc::SslServerCredentialsOptions options;
  options.pem_key_cert_pairs.push_back({own.key_pem(), own.certificate_pem()});
  return grpc::SslServerCredentials(options);
}

class TlsHost {
 public:
  TlsHost(const std::shared_ptr<grpc::ServerCredentials>& credentials, grpc::Service& service) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", credentials, &port);
    builder.RegisterService(&service);
    server_ = builder.BuildAndStart();
    address_ = fmt::format("127.0.0.1:{}", port);
  }
  ~TlsHost() { server_->Shutdown(std::chrono::system_clock::now()); }
  const std::string& address() const { return address_; }

 private:
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

void run(const Options& options, Bench& bench, const std::string& address, const std::string& old_address,
         bool tls) {
  const auto old = v1::ArchiveService::NewStub(dial(old_address));
  const RemoteArchive remote({address}, "bench", {}, Reading::kNeverMapped);
  std::vector<int> all;
  for (int i = 0; i < kFrames; ++i) all.push_back(i);
  for (const Region& region :
       {Region{"whole frames, 18 MB each", "region read, whole frames of 18 MB: rate over plain TCP", 0,
               kHeight, 1},
        Region{"bands of 32 rows, 384 kB of each frame", "region read, bands of 32 rows: rate over plain TCP",
               700, kBandRows, 40}}) {
    std::vector<std::string_view> pieces;
    v1::ReadRowsRequest request;
    request.set_session("bench");
    request.set_first_row(region.first_row);
    request.set_row_count(region.row_count);
    const size_t row = bench.archive->row_bytes();
    std::vector<std::shared_ptr<const MappedFile>> mapped;
    for (const v1::Frame& frame : bench.manifest.frames()) {
      mapped.push_back(bench.archive->map(frame.file()).value());
      pieces.push_back(
          mapped.back()->bytes().substr(kTiffPixelOffset + row * static_cast<size_t>(region.first_row),
                                        row * static_cast<size_t>(region.row_count)));
      request.add_files(frame.file());
    }
    const size_t size = row * static_cast<size_t>(region.row_count) * kFrames;
    Times plain, ours, as_fields;
    for (int round = 0; round < options.rounds + 1; ++round) {  // the first one warms up
      plain.measure(region.repeats, [&] { plain_copy(pieces, size); });
      ours.measure(region.repeats, [&] {
        if (!remote.rows(bench.manifest, all, region.first_row, region.row_count).ok()) std::abort();
      });
      as_fields.measure(region.repeats, [&] { read_fields(*old, request, size); });
    }
    const double bytes = static_cast<double>(size) * region.repeats;
    std::cout << fmt::format("{}{}\n", region.name, tls ? ", TLS" : "");
    report("  plain TCP", bytes, plain, plain);
    const double share = report("  ReadRows", bytes, ours, plain);
    report("  a field of bytes, copied, no checksums", bytes, as_fields, plain);
    if (!tls) print_row(region.row, share, "x");
  }
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  using namespace glasswing;
  keep_freed_memory();
  CLI::App app(
      "Measures the reading of regions of frames over loopback. Takes 1 GB below the directory for temporary "
      "files.");
  Options options;
  app.add_option("--rounds", options.rounds, "rounds of each, alternating")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const fs::path root = fs::temp_directory_path() / fmt::format("glasswing-archive-bench.{}", ::getpid());
  fs::create_directories(root);
  {
    Bench bench(root);
    ArchiveServiceImpl service(*bench.store);
    FieldService fields(*bench.archive);
    {
      const auto host = ServiceHost::start({}, {&service}).value(),
                 old = ServiceHost::start({}, {&fields}).value();
      run(options, bench, host->address(), old->address(), false);
    }
    const auto credentials = made_credentials(root);
    const TlsHost host(credentials, service), old(credentials, fields);
    run(options, bench, host.address(), old.address(), true);
  }
  fs::remove_all(root);
  return 0;
}
