"""Runs in child processes, so that a run that hangs or crashes costs one row and not the study."""

import json
import multiprocessing
import os
import subprocess
import sys


class NoAnswer(Exception):
    """A child process died or took too long."""


class Child:
    """A child process that answers one message after the other; it is replaced after a failure.

    Parameters
    ----------
    serve : function (pipe, *arguments)
        sends anything when it is ready, then answers each message that it receives, for ever
    method : str
        how multiprocessing starts the process: 'spawn', or 'fork' for arguments that cannot be pickled
    """

    def __init__(self, serve, *arguments, method='spawn'):
        self._serve, self._arguments = serve, arguments
        self._context, self._process = multiprocessing.get_context(method), None

    def send(self, message):
        """Send a message, to a new process if there is none."""
        if self._process is None or not self._process.is_alive():
            self._start()
        self._pipe.send(message)

    def receive(self, seconds):
        """The next answer.

        Raises
        ------
        NoAnswer
            when none comes within ``seconds``, or the process dies; it is stopped then
        """
        try:
            if self._pipe.poll(seconds):
                return self._pipe.recv()
            reason = f'stopped after {seconds:g} s'
        except EOFError:
            reason = 'the process died'
        self.stop()
        raise NoAnswer(reason)

    def stop(self):
        """Kill the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None

    def _start(self):
        self._pipe, theirs = self._context.Pipe()
        self._process = self._context.Process(target=self._serve, args=(theirs, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()
        self._pipe.recv()


def silence_output():
    """Discard everything that this process and the libraries in it print."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)


def json_lines(script, *arguments, limit):
    """Run a Python script in a process of its own.

    Parameters
    ----------
    limit : float
        seconds

    Returns
    -------
    rows : list of dict
        the lines of its output that are JSON objects
    status : str
        'ok', or the reason why it ended early
    """
    command = [sys.executable, script, *map(str, arguments)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired as error:
        printed, status = (error.stdout or b'').decode(), f'more than {limit:g} s'
    else:
        printed, status = done.stdout, _last_line(done.stderr) if done.returncode else 'ok'
    return [json.loads(line) for line in printed.splitlines() if line.startswith('{')], status


def _last_line(text):
    return (text.strip().splitlines() or ['failed without a message'])[-1][:200]
