"""Training wing: a robot partner learns beside a population of simulated participants.

`learning` runs the algorithm (PPO of Stable-Baselines3) in rounds, each of which can be resumed; open it first.
`population` says beside whom, `boards` is the adapter from `netboard.participants.environments` to the library,
`evaluation` plays whole blocks beside participants that were held out, and `results` writes weights, card, curve and
figure. `progress` is the folder of a training under way, and says what may be resumed. `onnx` exports weights for other
programs.

The libraries come with the extra ``train``. Nothing that runs a partner imports this wing: the agent and the server
read plain weights (`netboard.participants.robots.network`).
"""
