#include <fmt/format.h>

#include <functional>
#include <iostream>

#include "client/capture/stage_axes.h"
#include "client/capture/upload.h"
#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/queue/commands.h"
#include "client/queue/queue_text.h"
#include "client/queue/wish_options.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/queue_service.grpc.pb.h"

namespace glasswing {
namespace {

using Stub = v1::QueueService::Stub;
using QueuePeer = Peer<v1::QueueService>;
using Number = std::int64_t;

constexpr int kRetries = 3;
constexpr double kRetryWait_s = 60.0;

QueuePeer server_of(const Client& client) {
  return {client.server_title(), client.server};
}

// A call with a request id, made again where only its answer was lost.
template <typename Request, typename Response>
absl::StatusOr<Response> call_once(const QueuePeer& server,
                                   grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*),
                                   Request request) {
  request.set_request_id(random_token());
  absl::StatusOr<Response> answer = call(server, rpc, request);
  if (absl::IsDeadlineExceeded(answer.status())) answer = call(server, rpc, request);
  return answer;
}

absl::StatusOr<v1::QueueItem> item_of(const QueuePeer& server, Number number) {
  v1::GetQueueItemRequest request;
  request.set_number(number);
  GW_ASSIGN_OR_RETURN(v1::GetQueueItemResponse found, call(server, &Stub::GetQueueItem, request));
  return std::move(*found.mutable_item());
}

struct AddArguments {
  std::string plan, turn;
  int times = 1;
};

// Its photos are uploaded.
absl::StatusOr<v1::Plan> plan_with_photos(const Client& client, const std::string& file) {
  GW_ASSIGN_OR_RETURN(v1::Plan plan, read_plan(file));
  const Peer<v1::SessionService> sessions(client.server_title(), client.server);
  GW_RETURN_IF_ERROR(upload_photos(client, sessions, file, plan));
  return plan;
}

// The wishes of a series of poses: one session each, the empty stage from the first.
absl::StatusOr<std::vector<v1::QueueWish>> poses_of(const Client& client, const std::string& turn,
                                                    const v1::QueueWish& wish) {
  GW_RETURN_IF_ERROR(check_name("session", wish.session()));  // names the series
  GW_ASSIGN_OR_RETURN(const Poses poses, parse_poses("--turn", turn));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Axis> axes, read_axes(client, first_camera(wish.plan())));
  GW_ASSIGN_OR_RETURN(const v1::Axis axis, find_axis(poses.axis, axes, "deg"));
  GW_RETURN_IF_ERROR(check_poses("--turn", poses, axis));
  const std::vector<std::string> names = names_of_poses(wish.session(), poses.positions);
  std::vector<v1::QueueWish> wishes(names.size(), wish);
  for (size_t i = 0; i < names.size(); ++i) {
    wishes[i].set_session(names[i]);
    wishes[i].add_tags(wish.session());
    (*wishes[i].mutable_axes())[axis.name()] = poses.positions[i];
    if (i > 0 && !wish.plan().skip_empty_stage()) wishes[i].set_empty_stage_of(names.front());
  }
  return wishes;
}

absl::Status add_items(const Client& client, const AddArguments& arguments, const WishOptions& options) {
  v1::AddQueueItemRequest request;
  v1::QueueWish& wish = *request.mutable_wish();
  GW_ASSIGN_OR_RETURN(*wish.mutable_plan(), plan_with_photos(client, arguments.plan));
  wish.set_retries(kRetries);
  wish.set_retry_wait_s(kRetryWait_s);
  GW_RETURN_IF_ERROR(enter_wish(client, options, wish));
  if (arguments.times > 1 && !wish.session().empty() && wish.session().find("{item}") == std::string::npos)
    return absl::InvalidArgumentError(
        "--times makes several items; --session must tell them apart, as vase-{item}");
  const QueuePeer server = server_of(client);
  std::vector<v1::QueueWish> wishes(arguments.times, wish);
  if (!arguments.turn.empty()) {
    GW_ASSIGN_OR_RETURN(wishes, poses_of(client, arguments.turn, wish));
  }
  for (const v1::QueueWish& each : wishes) {
    *request.mutable_wish() = each;
    GW_ASSIGN_OR_RETURN(const v1::AddQueueItemResponse added,
                        call_once(server, &Stub::AddQueueItem, request));
    print_item(client, added.item());
  }
  if (client.json) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const v1::GetQueueResponse queue, call(server, &Stub::GetQueue, {}));
  if (!queue.queue().running()) std::cout << printable(state_text(queue.queue())) << "\n";
  return absl::OkStatus();
}

absl::Status edit_item(const Client& client, Number number, const std::string& plan,
                       const WishOptions& options) {
  const QueuePeer server = server_of(client);
  v1::EditQueueItemRequest request;
  request.set_number(number);
  GW_ASSIGN_OR_RETURN(const v1::QueueItem item, item_of(server, number));
  *request.mutable_wish() = item.wish();
  if (!plan.empty()) {
    GW_ASSIGN_OR_RETURN(*request.mutable_wish()->mutable_plan(), plan_with_photos(client, plan));
  }
  GW_RETURN_IF_ERROR(enter_wish(client, options, *request.mutable_wish()));
  GW_ASSIGN_OR_RETURN(const v1::EditQueueItemResponse edited, call(server, &Stub::EditQueueItem, request));
  print_item(client, edited.item());
  return absl::OkStatus();
}

absl::Status set_queue(const Client& client, bool running) {
  v1::SetQueueRequest request;
  request.set_running(running);
  GW_ASSIGN_OR_RETURN(const v1::SetQueueResponse set, call(server_of(client), &Stub::SetQueue, request));
  if (client.json) {
    print_json(set.queue());
  } else {
    std::cout << printable(state_text(set.queue())) << "\n";
  }
  return absl::OkStatus();
}

// Of an item that has the rig already the queue itself is paused.
absl::Status stop_after(const Client& client, Number number) {
  GW_ASSIGN_OR_RETURN(const v1::QueueItem item, item_of(server_of(client), number));
  if (item.state() != v1::QUEUE_ITEM_STATE_WAITING) return set_queue(client, false);
  WishOptions options;
  options.pause_after = true;
  return edit_item(client, number, "", options);
}

CLI::App& add_verb(CLI::App& queue, const std::string& verb, const std::string& help,
                   const std::string& examples) {
  CLI::App& command = *queue.add_subcommand(verb, help);
  command.footer("Examples:\n" + examples);
  return command;
}

std::shared_ptr<Number> add_number(CLI::App& command, const std::string& help = "the item's number") {
  auto number = std::make_shared<Number>(0);
  command.add_option("item", *number, help)->required()->check(CLI::PositiveNumber);
  return number;
}

// What a verb does with a number.
using ByNumber = std::function<absl::Status(const Client&, Number)>;

// Calls with the number, and prints the item that is answered, if one is.
template <typename Request, typename Response>
ByNumber calls(grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*)) {
  return [rpc](const Client& client, Number number) -> absl::Status {
    Request request;
    request.set_number(number);
    absl::StatusOr<Response> answer;
    if constexpr (requires { request.request_id(); }) {
      answer = call_once(server_of(client), rpc, request);
    } else {
      answer = call(server_of(client), rpc, request);
    }
    GW_RETURN_IF_ERROR(answer.status());
    if constexpr (requires { answer->item(); }) print_item(client, answer->item());
    return absl::OkStatus();
  };
}

struct NumberVerb {
  const char *verb, *help;
  ByNumber run;
  const char* number = "the item's number";
};

void add_number_verb(CLI::App& queue, Client& client, const NumberVerb& verb) {
  CLI::App& command = add_verb(queue, verb.verb, verb.help, fmt::format("  glasswing queue {} 7", verb.verb));
  const auto number = add_number(command, verb.number);
  command.callback([&client, number, run = verb.run] {
    client.run = [&client, number, run] { return run(client, *number); };
  });
}

void add_add_verb(CLI::App& queue, Client& client) {
  CLI::App& command = add_verb(
      queue, "add", "Add a capture to the end of the queue.",
      "  glasswing queue add deploy/plans/crystal.txtpb --session vase --solve\n"
      "  glasswing queue add deploy/plans/crystal.txtpb --session vase --solve --background harbour.png\n"
      "  glasswing queue add deploy/plans/crystal.txtpb --session 'vase-{item}' --times 8 --approval\n"
      "  glasswing queue add deploy/plans/crystal.txtpb --session vase --turn 0:350:10 --solve\n"
      "  glasswing queue add vase.txtpb --session vase-200 --rail-mm back:200 --doctor --retries 5\n"
      "  glasswing queue add vase.txtpb --session night --not-before \"$(date -d 20:00 +%FT%T%:z)\"");
  auto arguments = std::make_shared<AddArguments>();
  auto options = std::make_shared<WishOptions>();
  command.add_option("plan", arguments->plan, "the plan, a .txtpb file")->required();
  CLI::Option* times =
      command
          .add_option("--times", arguments->times, "add as many such items; the session needs {item} then")
          ->check(CLI::Range(1, 1000));
  command
      .add_option("--turn", arguments->turn,
                  "an item for each of these poses of a turntable, as capture --turn: 0:350:10, or 0,90,180; "
                  "--session names the series")
      ->type_name("[AXIS=]POSES")
      ->excludes(times);
  add_wish_options(command, options);
  command.callback([&client, arguments, options] {
    client.run = [&client, arguments, options] { return add_items(client, *arguments, *options); };
  });
}

void add_edit_verb(CLI::App& queue, Client& client) {
  CLI::App& command =
      add_verb(queue, "edit", "Change an item that waits; what is left out stays, but an approval ends.",
               "  glasswing queue edit 7 --exposure-ms 4,16\n"
               "  glasswing queue edit 7 --plan deploy/plans/quick.txtpb --no-solve");
  const auto number = add_number(command);
  auto plan = std::make_shared<std::string>();
  auto options = std::make_shared<WishOptions>();
  command.add_option("--plan", *plan, "another plan, a .txtpb file");
  add_wish_options(command, options);
  command.callback([&client, number, plan, options] {
    client.run = [&client, number, plan, options] { return edit_item(client, *number, *plan, *options); };
  });
}

void add_list_verbs(CLI::App& queue, Client& client) {
  CLI::App& list = add_verb(queue, "list", "List the items in the order of work.",
                            "  glasswing queue list\n  glasswing queue list --all --json");
  auto all = std::make_shared<bool>(false);
  list.add_flag("--all", *all, "also those that are done or failed");
  list.callback([&client, all] {
    client.run = [&client, all]() -> absl::Status {
      v1::GetQueueRequest request;
      request.set_ended(*all);
      GW_ASSIGN_OR_RETURN(const v1::GetQueueResponse answer,
                          call_pages(server_of(client), &Stub::GetQueue, request));
      print_queue(client, answer);
      return absl::OkStatus();
    };
  });
  CLI::App& history =
      add_verb(queue, "history", "Say who did what to the queue, when, and why; the newest first.",
               "  glasswing queue history\n  glasswing queue history --item 7 --tsv");
  auto item = std::make_shared<Number>(0);
  history.add_option("--item", *item, "of this item alone")->check(CLI::PositiveNumber);
  history.callback([&client, item] {
    client.run = [&client, item]() -> absl::Status {
      v1::ListQueueHistoryRequest request;
      request.set_item(*item);
      GW_ASSIGN_OR_RETURN(const v1::ListQueueHistoryResponse answer,
                          call_pages(server_of(client), &Stub::ListQueueHistory, request));
      print_history(client, answer);
      return absl::OkStatus();
    };
  });
}

absl::Status hold_queue(const Client& client, const v1::HoldQueueRequest& request) {
  GW_ASSIGN_OR_RETURN(const v1::HoldQueueResponse held, call(server_of(client), &Stub::HoldQueue, request));
  if (client.json) {
    print_json(held.hold());
  } else {
    std::cout << printable(hold_text(held.hold())) << "\n";
  }
  return absl::OkStatus();
}

void add_hold_verb(CLI::App& queue, Client& client) {
  CLI::App& hold =
      add_verb(queue, "hold", "Keep the rig free for people: nothing begins that would not end before.",
               "  glasswing queue hold 2026-11-30T14:00:00+01:00 2026-11-30T16:00:00+01:00 --why visitors\n"
               "  glasswing queue hold \"$(date -d 14:00 +%FT%T%:z)\" \"$(date -d 16:00 +%FT%T%:z)\"");
  auto request = std::make_shared<v1::HoldQueueRequest>();
  hold.add_option_function<std::string>(
          "from", [request](const std::string& from) { request->set_from(from); }, "RFC 3339")
      ->required()
      ->type_name("TIME");
  hold.add_option_function<std::string>(
          "to", [request](const std::string& to) { request->set_to(to); }, "RFC 3339")
      ->required()
      ->type_name("TIME");
  hold.add_option_function<std::string>(
      "--why", [request](const std::string& why) { request->set_why(why); }, "for others");
  hold.callback(
      [&client, request] { client.run = [&client, request] { return hold_queue(client, *request); }; });
}

void add_move_verb(CLI::App& queue, Client& client) {
  CLI::App& command = add_verb(queue, "move", "Move an item that waits.",
                               "  glasswing queue move 7 --before 3\n  glasswing queue move 7 --last");
  const auto number = add_number(command);
  auto before = std::make_shared<Number>(0);
  auto last = std::make_shared<bool>(false);
  CLI::Option* const to_end = command.add_flag("--last", *last, "to the end");
  command.add_option("--before", *before, "before this item, which waits too")
      ->check(CLI::PositiveNumber)
      ->excludes(to_end);
  command.callback([&client, number, before, last] {
    client.run = [&client, number, before, last]() -> absl::Status {
      if (*before == 0 && !*last) return absl::InvalidArgumentError("say where to: --before ITEM, or --last");
      v1::MoveQueueItemRequest request;
      request.set_number(*number);
      request.set_before(*before);
      GW_ASSIGN_OR_RETURN(const v1::MoveQueueItemResponse moved,
                          call(server_of(client), &Stub::MoveQueueItem, request));
      print_item(client, moved.item());
      return absl::OkStatus();
    };
  });
}

void add_queue_verbs(CLI::App& queue, Client& client) {
  CLI::App& start =
      add_verb(queue, "start", "Run what the queue has, and what is added later.", "  glasswing queue start");
  start.callback([&client] { client.run = [&client] { return set_queue(client, true); }; });
  CLI::App& pause =
      add_verb(queue, "pause", "Begin no further item; the running one goes on.", "  glasswing queue pause");
  pause.callback([&client] { client.run = [&client] { return set_queue(client, false); }; });
}

}  // namespace

void add_queue_commands(CLI::App& app, Client& client) {
  CLI::App& queue = *app.add_subcommand("queue", "Captures that the server runs one after the other.");
  queue.require_subcommand(1);
  queue.footer(
      "Examples:\n"
      "  glasswing queue add deploy/plans/crystal.txtpb --session vase --solve\n"
      "  glasswing queue start\n"
      "  glasswing queue list");
  add_add_verb(queue, client);
  add_list_verbs(queue, client);
  add_edit_verb(queue, client);
  add_move_verb(queue, client);
  add_hold_verb(queue, client);
  add_queue_verbs(queue, client);
  for (const NumberVerb& verb : {
           NumberVerb{"show", "Show an item; with --json all of it.", calls(&Stub::GetQueueItem)},
           NumberVerb{"duplicate", "Add a copy of an item, also of one that has ended.",
                      calls(&Stub::DuplicateQueueItem)},
           NumberVerb{"remove", "Remove an item that is not being captured; its session stays.",
                      calls(&Stub::RemoveQueueItem)},
           NumberVerb{"run", "Run an item next, also while the queue is paused, and approve it.",
                      calls(&Stub::RunQueueItem)},
           NumberVerb{"approve", "Approve an item that waits for it.", calls(&Stub::ApproveQueueItem)},
           NumberVerb{"stop-after", "Pause the queue once an item has been captured or has failed.",
                      stop_after},
           NumberVerb{"release", "Take back a time that was held for people; queue list numbers them.",
                      calls(&Stub::ReleaseQueue), "the hold's number"},
       })
    add_number_verb(queue, client, verb);
}

}  // namespace glasswing
