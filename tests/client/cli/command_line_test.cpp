// Properties of the whole tree of commands: descriptions, manual pages, completion.
#include <gmock/gmock.h>

#include <cstdio>
#include <fstream>

#include "client/cli/commands.h"
#include "core/cli/completion.h"
#include "core/cli/help.h"
#include "core/service/service.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/client/process.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

class CommandLine : public ScratchTest {
 protected:
  CommandLine() { add_commands(app_, client_, config_); }

  // Visits all commands with their full names: "plan check".
  static void visit(const CLI::App& app, const std::string& above,
                    const std::function<void(const CLI::App&, const std::string&)>& each) {
    for (const CLI::App* command : subcommands_of(app)) {
      each(*command, above + command->get_name());
      visit(*command, above + command->get_name() + " ", each);
    }
  }
  // The command's output, with its errors.
  static std::string output_of(const std::string& shell_command) {
    std::string text;
    FILE* const pipe = ::popen((shell_command + " 2>&1").c_str(), "r");
    for (char buffer[4096];;) {
      const size_t count = std::fread(buffer, 1, sizeof buffer, pipe);
      if (count == 0) break;
      text.append(buffer, count);
    }
    ::pclose(pipe);
    return text;
  }
  std::string write(const std::string& name, const std::string& text) const {
    const std::string path = (scratch_ / name).string();
    std::ofstream(path) << text;
    return path;
  }

  Client client_;
  CLI::App app_{"Description.", "glasswing"};
  Config config_{app_, call_settings()};
};

TEST_F(CommandLine, AnOutputThatCannotBeWrittenIsNamedBeforeAnyWork) {
  std::filesystem::create_directory(scratch_ / "sheet.png");
  const auto said = [&](const std::string& output) {
    return run_glasswing({"view", (scratch_ / "no.exr").string(), "-o", output}).err;
  };
  EXPECT_THAT(said((scratch_ / "sheet.jpg").string()), testing::HasSubstr("must end in .png"));
  EXPECT_THAT(said((scratch_ / "sheet.png").string()), testing::HasSubstr("is a directory"));
  EXPECT_THAT(said((scratch_ / "nowhere/sheet.png").string()), testing::HasSubstr("there is no directory"));
  EXPECT_THAT(said((scratch_ / "other.png").string()), testing::HasSubstr("no.exr"));
}

TEST_F(CommandLine, EndingsOfOutputsAreTheirFormats) {
  const auto said = [](std::vector<std::string> words) { return run_glasswing(words).err; };
  EXPECT_THAT(said({"preview", "-o", "live.png"}), testing::HasSubstr("must end in .jpg or .jpeg"));
  EXPECT_THAT(said({"plan", "make", "--monitor", "back:64x48", "-o", "plan.exr"}),
              testing::HasSubstr("must end in .txtpb"));
  EXPECT_THAT(said({"calibrate", "geometry", "a.exr", "--pitch-mm", "1", "-o", "rig.json"}),
              testing::HasSubstr("must end in .txtpb"));
  EXPECT_THAT(said({"composite", "vase.exr", "--background", "sea.png", "-o", "out.png", "--error", "e.png"}),
              testing::HasSubstr("--error e.png must be an .exr"));
  EXPECT_THAT(said({"web", "vase.exr", "-o", "-"}), testing::HasSubstr("it must be a directory"));
  EXPECT_THAT(said({"convert", "a.png", "-"}), testing::HasSubstr("the output is -; its name must end in"));
  const std::string file = write("file", "");
  EXPECT_THAT(said({"web", "vase.exr", "-o", file + "/web"}), testing::HasSubstr(file + " is not one"));
}

TEST_F(CommandLine, APictureIsNoPlanAndNoMatte) {
  const std::string picture = write("picture.png", "\x89PNG\r\n\x1a\n");
  expect_one_line_error(run_glasswing({"plan", "check", picture}),
                        picture + ": it is no text; a plan is a text file, as glasswing plan make writes it");
  expect_one_line_error(run_glasswing({"view", picture, "-o", (scratch_ / "sheet.png").string()}),
                        picture + ": it is damaged or not a matte: it is not an OpenEXR file");
}

TEST_F(CommandLine, AnAnswerThatCannotBeWrittenIsAFailure) {
  EXPECT_EQ(output_of("(" + program_path() + " config > /dev/full; echo $?)"),
            "glasswing: the answer could not be written to standard output\n1\n");
  EXPECT_EQ(output_of("(" + program_path() + " --help > /dev/full; echo $?)"),
            "glasswing: the answer could not be written to standard output\n1\n");
}

TEST_F(CommandLine, APlanThatCannotBeWrittenIsAFailure) {
  EXPECT_EQ(output_of("(" + program_path() + " plan make --monitor back:64x48 > /dev/full; echo $?)"),
            "glasswing: cannot write to standard output: No space left on device\n1\n");
}

TEST_F(CommandLine, EverythingIsDescribedAndHasAnExample) {
  int commands = 0;
  visit(app_, "", [&](const CLI::App& command, const std::string& name) {
    ++commands;
    EXPECT_TRUE(command.get_description().ends_with('.')) << name;
    EXPECT_NE(command.get_group(), "Subcommands") << name;
    const Footer footer = footer_of(command);
    EXPECT_FALSE(footer.examples.empty()) << name;
    for (const std::string& example : footer.examples)
      EXPECT_NE(example.find("glasswing "), std::string::npos) << name << ": " << example;
    for (const CLI::Option* option : command.get_options())
      EXPECT_FALSE(option->get_description().empty()) << name << " " << option->get_name();
    EXPECT_EQ(run_glasswing({"--help"}).out.find("Subcommands"), std::string::npos);
  });
  EXPECT_GE(commands, 25);
}

TEST_F(CommandLine, ManualPagesAreGoodTroff) {
  const std::string directory = (scratch_ / "man").string();
  ASSERT_EQ(run_glasswing({"man", directory}).status, 0);
  EXPECT_TRUE(std::filesystem::exists(directory + "/glasswing.1"));
  visit(app_, "", [&](const CLI::App&, std::string name) {
    std::ranges::replace(name, ' ', '-');
    EXPECT_TRUE(std::filesystem::exists(directory + "/glasswing-" + name + ".1")) << name;
  });
  EXPECT_EQ(output_of("for page in " + directory + "/*; do man --warnings -l \"$page\" >/dev/null; done"),
            "");
  // Messages below warnings are matters of style.
  EXPECT_EQ(output_of("mandoc -T lint -W warning " + directory + "/*"), "");
}

// A server with two sessions.
class Completion : public CommandLine {
 protected:
  struct Sessions : v1::SessionService::Service {
    grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                              v1::ListSessionsResponse* response) override {
      for (const char* name : {"vase", "vessel"}) response->add_sessions()->set_name(name);
      return grpc::Status::OK;
    }
  } sessions_;
  Completion() : host_(ServiceHost::start({}, {&sessions_}).value()) {
    write("vase.exr", "");
    write("notes.txt", "");
    std::filesystem::create_directories(scratch_ / "views");
  }

  // The candidates that bash offers for this line, separated by spaces.
  std::string bash(const std::string& line) {
    const std::string script = write("glasswing.bash", completion_script("bash", "glasswing"));
    const std::string words = output_of("cd " + scratch_.string() + " && bash -c 'source " + script +
                                        "; COMP_LINE=$1 COMP_POINT=${#1} " + "COMP_WORDS=(" + program_path() +
                                        "); _glasswing; echo \"${COMPREPLY[@]}\"' - '" + line + "'");
    return words.substr(0, words.find('\n'));
  }
  std::string fish(const std::string& line) {
    const std::string script = write("glasswing.fish", completion_script("fish", "glasswing"));
    return output_of("cd " + scratch_.string() +
                     " && PATH=" + std::filesystem::absolute(program_path()).parent_path().string() +
                     ":$PATH GLASSWING_SERVER=" + host_->address() + " HOME=" + scratch_.string() +
                     " fish --no-config -c 'source " + script + "; complete -C \"" + line +
                     "\"' | cut -f1 | sort | paste -sd' ' | tr -d '\\n'");
  }

  std::unique_ptr<ServiceHost> host_;
};

TEST_F(Completion, CandidatesComeFromTheCommandLineItself) {
  const auto candidates = [](std::vector<std::string> words) {
    words.insert(words.begin(), {"__complete", "--"});
    return run_glasswing(words).out;
  };
  EXPECT_TRUE(candidates({"plan", "c"}).starts_with("check\tCheck a plan"));
  EXPECT_EQ(candidates({"composite", "--format", ""}), "exr\npng\ntif\n");
  EXPECT_EQ(candidates({"composite", "--format=t"}), "tif\n");
  EXPECT_EQ(candidates({"composite", ""}), ":FILE\n");
  EXPECT_EQ(candidates({"import", "v", "--archive="}), ":DIR\n");
  EXPECT_EQ(candidates({"--server", host_->address(), "delete", "vase", "v"}), "vase\nvessel\n");
  EXPECT_EQ(candidates({"--server", host_->address(), "show", "vase", ""}), "");
  EXPECT_EQ(candidates({"nodes", "--nothing="}), "");
}

TEST_F(Completion, BashOffersWhatMayFollow) {
  EXPECT_EQ(bash("glasswing exp"), "export");
  EXPECT_EQ(bash("glasswing plan "), "make design check estimate");
  EXPECT_EQ(bash("glasswing matte "), "crop resize flip grade merge join fill deliver");
  EXPECT_EQ(bash("glasswing matte grade vase.exr --only "), "passing foreground");
  EXPECT_EQ(bash("glasswing matte merge va"), "vase.exr");
  EXPECT_EQ(bash("glasswing matte deliver vase.exr --ids va"), "vase.exr");
  EXPECT_EQ(bash("glasswing convert va --ocio-config va"), "vase.exr");
  EXPECT_EQ(bash("glasswing --server 127.0.0.1:1 comple"), "completion");
  EXPECT_EQ(bash("glasswing capture --se"), "--session --server");
  EXPECT_EQ(bash("glasswing composite vase.exr --form"), "--format");
  EXPECT_EQ(bash("glasswing composite --format "), "exr png tif");
  EXPECT_EQ(bash("glasswing composite --format=p"), "png");
  EXPECT_EQ(bash("glasswing composite va"), "vase.exr");
  EXPECT_EQ(bash("glasswing blur vase.exr -o n"), "notes.txt");
  EXPECT_EQ(bash("glasswing nu"), "nuke");
  EXPECT_EQ(bash("glasswing nuke va"), "vase.exr");
  EXPECT_EQ(bash("glasswing import v --archive v"), "views");
  EXPECT_EQ(bash("glasswing completion "), "bash zsh fish");
  EXPECT_EQ(bash("glasswing preview --fps "), "");
  EXPECT_EQ(bash("glasswing solve v --method fringe --set t"), "tolerance=");
  EXPECT_EQ(bash("glasswing live --set smoothing=p"), "smoothing=perona-malik");
}

TEST_F(Completion, BashOffersTheServersSessions) {
  const std::string server = "--server " + host_->address() + " ";
  EXPECT_EQ(bash("glasswing " + server + "show "), "vase vessel");
  EXPECT_EQ(bash("glasswing show --server=" + host_->address() + " ves"), "vessel");
  EXPECT_EQ(bash("glasswing " + server + "calibrate camera --session va"), "vase");
  EXPECT_EQ(bash("glasswing " + server + "calibrate geometry vase ve"), "vessel");
  EXPECT_EQ(bash("glasswing calibrate geo"), "geometry");
  EXPECT_EQ(bash("glasswing --server 127.0.0.1:1 show "), "");  // silently
}

TEST_F(Completion, FishOffersWhatMayFollow) {
  EXPECT_EQ(fish("glasswing exp"), "export");
  EXPECT_EQ(fish("glasswing nuk"), "nuke");
  EXPECT_EQ(fish("glasswing plan "), "check design estimate make");
  EXPECT_EQ(fish("glasswing --server 127.0.0.1:1 comple"), "completion");
  EXPECT_EQ(fish("glasswing composite --format "), "exr png tif");
  EXPECT_EQ(fish("glasswing show v"), "vase vessel");
  EXPECT_EQ(fish("glasswing composite vas"), "vase.exr");
}

// zsh completes only in an interactive shell, so this runs one on a pseudo-terminal.
TEST_F(Completion, ZshOffersWhatMayFollow) {
  const std::string script = write("_glasswing", completion_script("zsh", "glasswing"));
  EXPECT_EQ(output_of("zsh -n " + script), "");
  const std::string driver = write("driver.zsh", R"zsh(
zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell "PS1=; autoload -U compinit; compinit -D; zstyle ':completion:*' list-prompt ''; source $1
bindkey '^I' list-choices; LISTMAX=1000; stty -echo; print READY"
zpty -r shell seen $'*\nREADY*'
zpty -w -n shell "$2"$'\t\n'"print -n DO; print NE"$'\n'
zpty -r shell seen '*DONE*'
print -r -- $seen
)zsh");
  const auto offered = [&](const std::string& line) {
    return output_of("cd " + scratch_.string() +
                     " && PATH=" + std::filesystem::absolute(program_path()).parent_path().string() +
                     ":$PATH GLASSWING_SERVER=" + host_->address() + " timeout 30 zsh -f " + driver + " " +
                     script + " '" + line + "'");
  };
  EXPECT_NE(offered("glasswing plan ").find("estimate"), std::string::npos);
  EXPECT_NE(offered("glasswing show ").find("vessel"), std::string::npos);
  EXPECT_NE(offered("glasswing composite --format ").find("tif"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
