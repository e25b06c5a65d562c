#!/usr/bin/env bash
# Runs the command blocks of README.md, docs/operation.md and docs/measured.md as they are printed, one after
# the other, in one shell, in an empty folder, with the given binary as `triplanar`:
#   tests/readme.sh target/release/triplanar
# A comment right above a block says what is special about it:
#   <!-- not run: why -->           left out
#   <!-- needs: tool tool -->       left out where a tool is not there (with README_ALL=1 a failure)
#   <!-- the end of what the block above prints -->   the block is no command, but held against that
# The last line is "N passed, N failed". The ports that README names must be free.
set -euo pipefail
exec python3 - "$(realpath "${1:?the program, e.g. target/release/triplanar}")" \
  "$(realpath "$(dirname "$0")/..")" <<'PY'
import os, re, shutil, signal, socket, subprocess, sys, tempfile

program, repository = sys.argv[1:]
PAGES = 'README.md', 'docs/operation.md', 'docs/measured.md'
PORTS = 8080, 11112
OUTPUT = 'the end of what the block above prints'
# A block that takes longer hangs: a series of 145 slices takes seconds.
TIMEOUT = 300

blocks = []
for page in PAGES:
    lines = open(os.path.join(repository, page), encoding='utf-8').read().split('\n')
    tag, at = '', 0
    while at < len(lines):
        line = lines[at]
        if comment := re.fullmatch(r'<!-- (.*) -->', line):
            tag = comment[1]
        elif line.startswith('```'):
            end = lines.index('```', at + 1)
            if line == '```sh' or tag == OUTPUT:
                blocks.append((f'{page}:{at + 1}', tag, '\n'.join(lines[at + 1:end]) + '\n'))
            tag, at = '', end
        else:
            tag = ''
        at += 1

for port in PORTS:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(('127.0.0.1', port))
        except OSError as error:
            sys.exit(f'port {port} is not free: {error}')

folder = tempfile.mkdtemp(prefix='readme-')
tools = os.path.join(folder, 'bin')
work = os.path.join(folder, 'work')
os.mkdir(tools), os.mkdir(work)
os.symlink(program, os.path.join(tools, 'triplanar'))
environment = {name: value for name, value in os.environ.items() if not name.startswith('TRIPLANAR_')}
environment['PATH'] = tools + os.pathsep + environment['PATH']
# Of its own group, so that what it leaves in the background can be ended.
shell = subprocess.Popen(['bash'], cwd=work, env=environment, text=True, bufsize=1, start_new_session=True,
                         stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
END = 'readme.sh: the block ended with'


def run(text):
    """What a block prints, and how it ended: a command that fails ends the block."""
    with open(os.path.join(folder, 'block'), 'w') as block:
        block.write(f'set -e\n{text}set +e\n')
    # Sourced, so that variables and jobs go on to the next block; `return` instead of an exit.
    shell.stdin.write(f'''trap 'echo "{END} $?"; exit' EXIT
. {folder}/block
trap - EXIT
echo "{END} 0"
''')
    shell.stdin.flush()
    signal.alarm(TIMEOUT)
    printed = []
    for line in shell.stdout:
        if found := re.search(END + r' (\d+)', line):
            signal.alarm(0)
            return ''.join(printed), int(found[1])
        printed.append(line)
    return ''.join(printed), 1


passed = failed = 0
printed = ''
try:
    for where, tag, text in blocks:
        needed = tag.removeprefix('needs: ').split() if tag.startswith('needs: ') else []
        missing = [tool for tool in needed if not shutil.which(tool)]
        if tag.startswith('not run: '):
            print(f'not run: {where}: {tag[9:]}')
            continue
        if tag == OUTPUT:
            ok = printed.rstrip().endswith(text.rstrip())
            printed = f'it prints\n{printed}'
        elif missing:
            ok = os.environ.get('README_ALL') != '1'
            printed = f'no {" ".join(missing)}'
            if ok:
                print(f'not run: {where}: {printed}')
                continue
        else:
            printed, status = run(text)
            ok = status == 0
        passed, failed = passed + ok, failed + (not ok)
        print(f'{"ok" if ok else "FAILED"}: {where}', flush=True)
        if not ok:
            print(printed)
            if tag != OUTPUT:
                break
finally:
    try:
        os.killpg(shell.pid, signal.SIGTERM)
        shell.wait(30)
    except (ProcessLookupError, subprocess.TimeoutExpired):
        pass
    shutil.rmtree(folder, ignore_errors=True)
if passed < 8:
    failed += 1
    print('FAILED: the pages have fewer command blocks than they should')
print(f'{passed} passed, {failed} failed')
sys.exit(failed > 0)
PY
